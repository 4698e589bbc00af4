@ The sums of vector.rs on a Cortex-M4F: the same operations on every number in the same order, so the same bits. Four
@ numbers a round, loaded and stored by one instruction each.

.syntax unified
.fpu fpv4-sp-d16

.macro vector_function name
.section .text.\name,"ax",%progbits
.global \name
.type \name,%function
.thumb_func
\name:
.endm

@ r0 a   r1 its length   r2 b   r3 its length   s0 the sum, at first 0
vector_function rigident_dot
    cmp r3, r1
    it lo
    movlo r1, r3
    movs r3, #0
    vmov s0, r3
    subs r1, #4
    blo 2f
1:
    vldmia r0!, {s4-s7}
    vldmia r2!, {s8-s11}
    vmul.f32 s4, s4, s8
    vmul.f32 s5, s5, s9
    vadd.f32 s0, s0, s4
    vmul.f32 s6, s6, s10
    vadd.f32 s0, s0, s5
    vmul.f32 s7, s7, s11
    vadd.f32 s0, s0, s6
    subs r1, #4
    vadd.f32 s0, s0, s7
    bhs 1b
2:  @ the two lowest bits of what is left: carry and sign
    lsls r1, r1, #31
    bcc 3f
    vldmia r0!, {s4-s5}
    vldmia r2!, {s8-s9}
    vmul.f32 s4, s4, s8
    vmul.f32 s5, s5, s9
    vadd.f32 s0, s0, s4
    vadd.f32 s0, s0, s5
3:
    bpl 4f
    vldr s4, [r0]
    vldr s8, [r2]
    vmul.f32 s4, s4, s8
    vadd.f32 s0, s0, s4
4:
    bx lr
.size rigident_dot, . - rigident_dot

@ r0 to   r1 its length   r2 from   r3 its length   s0 by
vector_function rigident_add_scaled
    cmp r3, r1
    it lo
    movlo r1, r3
    subs r1, #4
    blo 2f
1:
    vldmia r2!, {s4-s7}
    vldmia r0, {s8-s11}
    vmul.f32 s4, s4, s0
    vmul.f32 s5, s5, s0
    vmul.f32 s6, s6, s0
    vmul.f32 s7, s7, s0
    vadd.f32 s8, s8, s4
    vadd.f32 s9, s9, s5
    vadd.f32 s10, s10, s6
    vadd.f32 s11, s11, s7
    subs r1, #4
    vstmia r0!, {s8-s11}
    bhs 1b
2:
    lsls r1, r1, #31
    bcc 3f
    vldmia r2!, {s4-s5}
    vldmia r0, {s8-s9}
    vmul.f32 s4, s4, s0
    vmul.f32 s5, s5, s0
    vadd.f32 s8, s8, s4
    vadd.f32 s9, s9, s5
    vstmia r0!, {s8-s9}
3:
    bpl 4f
    vldr s4, [r2]
    vldr s8, [r0]
    vmul.f32 s4, s4, s0
    vadd.f32 s8, s8, s4
    vstr s8, [r0]
4:
    bx lr
.size rigident_add_scaled, . - rigident_add_scaled

@ r0 numbers   r1 how many   s0 by
vector_function rigident_scale
    subs r1, #4
    blo 2f
1:
    vldmia r0, {s4-s7}
    vmul.f32 s4, s4, s0
    vmul.f32 s5, s5, s0
    vmul.f32 s6, s6, s0
    vmul.f32 s7, s7, s0
    subs r1, #4
    vstmia r0!, {s4-s7}
    bhs 1b
2:
    adds r1, #4
    beq 4f
3:
    vldr s4, [r0]
    vmul.f32 s4, s4, s0
    subs r1, #1
    vstmia r0!, {s4}
    bne 3b
4:
    bx lr
.size rigident_scale, . - rigident_scale

@ a.a, b.b and a.b to s0, s1 and s2
.macro square a, b
    vmul.f32 s12, \a, \a
    vmul.f32 s13, \b, \b
    vmul.f32 s14, \a, \b
    vadd.f32 s0, s0, s12
    vadd.f32 s1, s1, s13
    vadd.f32 s2, s2, s14
.endm

@ r0 a   r1 b   r2 numbers of each
vector_function rigident_squares
    movs r3, #0
    vmov s0, r3
    vmov.f32 s1, s0
    vmov.f32 s2, s0
    subs r2, #4
    blo 2f
1:
    vldmia r0!, {s4-s7}
    vldmia r1!, {s8-s11}
    square s4, s8
    square s5, s9
    square s6, s10
    subs r2, #4
    square s7, s11
    bhs 1b
2:
    adds r2, #4
    beq 4f
3:
    vldmia r0!, {s4}
    vldmia r1!, {s8}
    subs r2, #1
    square s4, s8
    bne 3b
4:
    bx lr
.size rigident_squares, . - rigident_squares

@ p and q become s0 p - s1 q and s1 p + s0 q
.macro rotate p, q
    vmul.f32 s12, s0, \p
    vmul.f32 s14, s1, \p
    vmul.f32 s13, s1, \q
    vmul.f32 s15, s0, \q
    vsub.f32 \p, s12, s13
    vadd.f32 \q, s14, s15
.endm

@ r0 p   r1 q   r2 numbers of each
vector_function rigident_rotate
    subs r2, #4
    blo 2f
1:
    vldmia r0, {s4-s7}
    vldmia r1, {s8-s11}
    rotate s4, s8
    rotate s5, s9
    rotate s6, s10
    rotate s7, s11
    subs r2, #4
    vstmia r0!, {s4-s7}
    vstmia r1!, {s8-s11}
    bhs 1b
2:
    adds r2, #4
    beq 4f
3:
    vldr s4, [r0]
    vldr s8, [r1]
    rotate s4, s8
    subs r2, #1
    vstmia r0!, {s4}
    vstmia r1!, {s8}
    bne 3b
4:
    bx lr
.size rigident_rotate, . - rigident_rotate
