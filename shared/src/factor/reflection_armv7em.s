@ `reduce` of reflection.rs on a Cortex-M4F: the same operations on every number in the same order, so the same bits.
@ One column at a time stays in registers while the reflections of all earlier columns are applied to it, two in a
@ round, each loaded by one instruction. No float instruction waits for the one before it where something else could
@ be between.
@
@ r0 this column of [R z]   r1 stride of these, bytes   r2 pivots left   r3 the block's columns, 52 bytes each: rows, k
@ r4 this column of the block   r5 pairs of reflections left   r6 reflection   r7 its entry in this column
@ r8 reflections so far   r9 least |x|^2   of a part: they come on the stack, and in r12 where to stop
@ s0-s11 y   s12 k   s13 one   s14 s15 sums   s16-s27 the column   s28 s29 products   s30 s31 entries

.syntax unified
.fpu fpv4-sp-d16

@ Two more products of a sum over even (s14) and odd (s15) rows.
.macro sum_products a, b, c, d
    vmul.f32 s28, \a, \b
    vmul.f32 s29, \c, \d
    vadd.f32 s14, s14, s28
    vadd.f32 s15, s15, s29
.endm

@ The same in half the instructions and as many cycles more: VMLA rounds twice, as a product and a sum do.
.macro sum_products_short a, b, c, d
    vmla.f32 s14, \a, \b
    vmla.f32 s15, \c, \d
.endm

@ s14 + s15 = |c|^2
.macro sum_squares
    vmul.f32 s14, s16, s16
    vmul.f32 s15, s17, s17
    sum_products s18, s18, s19, s19
    sum_products s20, s20, s21, s21
    sum_products s22, s22, s23, s23
    sum_products s24, s24, s25, s25
    sum_products s26, s26, s27, s27
.endm

@ Two rows: c -= u y, with the next two products.
.macro subtract a, b, y, z
    vsub.f32 \a, \a, s28
    vsub.f32 \b, \b, s29
    vmul.f32 s28, \y, s14
    vmul.f32 s29, \z, s14
.endm

@ u = k (y.c - entry), entry += u, c -= u y
.macro apply short, entry, between
    vmul.f32 s14, s0, s16
    vmul.f32 s15, s1, s17
    sum_products s2, s18, s3, s19
    vsub.f32 s14, s14, \entry
    sum_products s4, s20, s5, s21
    sum_products s6, s22, s7, s23
.if \short
    sum_products_short s8, s24, s9, s25
.else
    sum_products s8, s24, s9, s25
.endif
    vmul.f32 s28, s10, s26
    vmla.f32 s15, s11, s27
    vadd.f32 s14, s14, s28
    \between
    vadd.f32 s14, s14, s15
    vmul.f32 s14, s14, s12
    vmul.f32 s28, s0, s14
    vmul.f32 s29, s1, s14
    vadd.f32 \entry, \entry, s14
    subtract s16, s17, s2, s3
    subtract s18, s19, s4, s5
    subtract s20, s21, s6, s7
    subtract s22, s23, s8, s9
    subtract s24, s25, s10, s11
    vsub.f32 s26, s26, s28
    vsub.f32 s27, s27, s29
.endm

.macro reduction name, short, packed, part
.section .text.\name,"ax",%progbits
.global \name
.type \name,%function
.thumb_func
\name:
    push {r4-r9, lr}
.if \part
    ldrd r8, r12, [sp, #28]
.endif
    vpush {s16-s31}
    vmov.f32 s13, #1.0
    movw r9, #0x92ef        @ 1e-18
    movt r9, #0x2193
    mov r4, r3
.if \part
    cmp r8, #0
    beq 0f
    @ The reflections of the columns before were made by an earlier call.
    movs r5, #52
    mla r4, r8, r5, r3
    mla r0, r8, r1, r0
    subs r2, r8
    mov r6, r3
    b 3f
0:
.else
    movs r8, #0
.endif
    vldmia r4, {s16-s27}
    mov r7, r0
    b 2f
1:
    vldmia r6!, {s0-s12}
    vldmia r7!, {s30-s31}
    apply \short, s30, "subs r5, #1"
    vldmia r6!, {s0-s12}
    apply \short, s31, "vstr s30, [r7, #-8]"
    vstr s31, [r7, #-4]
    bne 1b
2:  @ r' = sqrt(r^2 + |x|^2), s = r + r', e = s/|x|^2, y = e x, k = 1/(r' e), with one division
    subs r2, #1
    bmi 5f
    vldr s30, [r7]
    sum_squares
    vmul.f32 s29, s30, s30
    vadd.f32 s28, s14, s15
    add r0, r1
.if \packed
    adds r1, #4             @ the next column is one longer
.endif
    vmov r6, s28
    vadd.f32 s29, s29, s28
    cmp r6, r9
    bls 4f
    vsqrt.f32 s29, s29
    adds r8, #1
    vadd.f32 s30, s30, s29
    vmul.f32 s12, s28, s28
    vmul.f32 s14, s29, s30
    vstr s29, [r7]
    vmul.f32 s15, s14, s28
    vmul.f32 s14, s14, s30
    vdiv.f32 s15, s13, s15
    mov r6, r3
    vmul.f32 s14, s14, s15
    vmul.f32 s12, s12, s15
    vmul.f32 s0, s16, s14
    vmul.f32 s1, s17, s14
    vmul.f32 s2, s18, s14
    vmul.f32 s3, s19, s14
    vmul.f32 s4, s20, s14
    vmul.f32 s5, s21, s14
    vmul.f32 s6, s22, s14
    vmul.f32 s7, s23, s14
    vmul.f32 s8, s24, s14
    vmul.f32 s9, s25, s14
    vmul.f32 s10, s26, s14
    vmul.f32 s11, s27, s14
    vstmia r4!, {s0-s12}
3:
.if \part
    cmp r8, r12
    beq 6f
.endif
    vldmia r4, {s16-s27}
    mov r7, r0
    lsrs r5, r8, #1
    bcc 1b
    vldmia r6!, {s0-s12}
    vldmia r7!, {s30}
    apply \short, s30
    vstr s30, [r7, #-4]
    bne 1b
    b 2b
4:  @ Nothing to reflect.
    adds r8, #1
    mov r6, r3
    vsub.f32 s0, s13, s13
.irp i, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12
    vmov.f32 s\i, s0
.endr
    vstmia r4!, {s0-s12}
    b 3b
5:
    sum_squares
    vadd.f32 s0, s14, s15
6:
    vpop {s16-s31}
    pop {r4-r9, pc}
.size \name, . - \name
.endm

reduction rigident_reduce, 0, 0, 0
reduction rigident_reduce_large, 1, 0, 0
reduction rigident_reduce_packed, 1, 1, 0
reduction rigident_reduce_part, 1, 0, 1
