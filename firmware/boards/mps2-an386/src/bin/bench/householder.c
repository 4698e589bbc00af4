/* The baseline that `cargo xtask bench-target --baseline` compares with; never part of a firmware.

   A dense block Householder as in textbooks (LAPACK's larfg and larf, unblocked): six rows, given by columns, are
   moved into the upper triangle of [R z], row-major, n rows of n + 1. Column n is the right-hand side; what is left
   in it are the residuals. With s = -sign(r) sqrt(r^2 + |x|^2):  v = [1; x/(r - s)],  tau = (s - r)/s,  r <- s,
   and for every later column c with its entry e in r's row:  w = tau (e + v.c),  e <- e - w,  c <- c - w v. */

#define ROWS 6

static inline __attribute__((always_inline)) void absorb(int n, float *restrict triangle,
                                                         float (*restrict columns)[ROWS]) {
    for (int j = 0; j < n; j++) {
        float *row = triangle + j * (n + 1);
        float v[ROWS], sum = 0.0f, r = row[j];
        for (int i = 0; i < ROWS; i++) {
            v[i] = columns[j][i];
            sum += v[i] * v[i];
        }
        if (sum == 0.0f)
            continue;
        float norm = __builtin_sqrtf(r * r + sum);
        float s = r > 0.0f ? -norm : norm;
        float scale = 1.0f / (r - s), tau = (s - r) / s;
        for (int i = 0; i < ROWS; i++)
            v[i] *= scale;
        row[j] = s;
        for (int k = j + 1; k <= n; k++) {
            float w = row[k];
            for (int i = 0; i < ROWS; i++)
                w += v[i] * columns[k][i];
            w *= tau;
            row[k] -= w;
            for (int i = 0; i < ROWS; i++)
                columns[k][i] -= w * v[i];
        }
    }
}

#define SIZE(n)                                                                        \
    void householder_##n(float *triangle, float (*columns)[ROWS]) {                    \
        absorb(n, triangle, columns);                                                  \
    }

SIZE(10)
SIZE(16)
SIZE(19)
SIZE(36)
SIZE(128)
