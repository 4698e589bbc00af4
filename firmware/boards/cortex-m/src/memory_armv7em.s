@ What the compiler copies and clears memory with, where it knows that it is aligned to words: four words a round. The
@ run-time ABI's names (IHI 0043, 4.3.4), in place of those of `compiler_builtins`, which are weak.

.syntax unified

.macro memory_function name
.section .text.\name,"ax",%progbits
.global \name
.type \name,%function
.thumb_func
\name:
.endm

@ r0 to   r1 from   r2 bytes
.global __aeabi_memcpy8
.thumb_set __aeabi_memcpy8, __aeabi_memcpy4
memory_function __aeabi_memcpy4
    subs r2, #16
    blo 2f
    push {r4, lr}
1:
    ldmia r1!, {r3, r4, r12, lr}
    subs r2, #16
    stmia r0!, {r3, r4, r12, lr}
    bhs 1b
    pop {r4, lr}
2:
    adds r2, #12
    bmi 4f
3:
    ldr r3, [r1], #4
    subs r2, #4
    str r3, [r0], #4
    bpl 3b
4:
    adds r2, #4
    beq 6f
5:
    ldrb r3, [r1], #1
    subs r2, #1
    strb r3, [r0], #1
    bne 5b
6:
    bx lr
.size __aeabi_memcpy4, . - __aeabi_memcpy4

@ r0 to   r1 bytes
.global __aeabi_memclr8
.thumb_set __aeabi_memclr8, __aeabi_memclr4
memory_function __aeabi_memclr4
    movs r2, #0
    subs r1, #16
    blo 2f
    push {r4, lr}
    movs r3, #0
    movs r4, #0
    mov r12, r2
1:
    subs r1, #16
    stmia r0!, {r2, r3, r4, r12}
    bhs 1b
    pop {r4, lr}
2:
    adds r1, #12
    bmi 4f
3:
    subs r1, #4
    str r2, [r0], #4
    bpl 3b
4:
    adds r1, #4
    beq 6f
5:
    subs r1, #1
    strb r2, [r0], #1
    bne 5b
6:
    bx lr
.size __aeabi_memclr4, . - __aeabi_memclr4

@ As memcpy, but for bytes that overlap with `to` behind `from`.
.global __aeabi_memmove8
.thumb_set __aeabi_memmove8, __aeabi_memmove4
memory_function __aeabi_memmove4
    subs r3, r0, r1
    cmp r3, r2
    bhs __aeabi_memcpy4
    b memmove
.size __aeabi_memmove4, . - __aeabi_memmove4
