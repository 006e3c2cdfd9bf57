// Direct gravitation with G = 1: s holds x, y, z, u, v, w, mass one after another, n numbers each; one symplectic Euler step.
#include <math.h>

void frame(float *s, long n, float soft2, float h) {
    float *restrict x = s, *restrict y = s + n, *restrict z = s + 2 * n, *restrict m = s + 6 * n;
    float *velocity = s + 3 * n;
#pragma omp parallel for schedule(static)
    for (long i = 0; i < n; i++) {
        const float X = x[i], Y = y[i], Z = z[i];
        float ax = 0, ay = 0, az = 0;
#pragma omp simd reduction(+ : ax, ay, az)
        for (long j = 0; j < n; j++) {
            const float dx = x[j] - X, dy = y[j] - Y, dz = z[j] - Z;
            const float inverse = 1.0f / sqrtf(dx * dx + dy * dy + dz * dz + soft2);
            const float pull = m[j] * inverse * inverse * inverse;
            ax += pull * dx, ay += pull * dy, az += pull * dz;
        }
        velocity[i] += h * ax, velocity[i + n] += h * ay, velocity[i + 2 * n] += h * az;
    }
    for (long q = 0; q < 3 * n; q++) s[q] += h * velocity[q];
}
