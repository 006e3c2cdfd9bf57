// Damped springs, gathered: every particle goes through its own list of neighbours, so nothing is written twice.
#include <math.h>

// s, out: 8 numbers for each particle: x, y, z, 0, u, v, w, 0.
static void step(const float *s, float *out, long n, const unsigned *start, const unsigned *neighbour,
                 const float *rest, const float *w, float ks, float kd, float h, float g) {
#pragma omp parallel for schedule(static)
    for (long i = 0; i < n; i++) {
        const float *p = s + 8 * i;
        float *o = out + 8 * i;
        const float x = p[0], y = p[1], z = p[2], u = p[4], v = p[5], r = p[6];
        float fx = 0, fy = 0, fz = 0;
        for (unsigned e = start[i]; e < start[i + 1]; e++) {
            const float *q = s + 8 * (unsigned long)neighbour[e];
            const float dx = x - q[0], dy = y - q[1], dz = z - q[2];
            const float along = dx * (u - q[4]) + dy * (v - q[5]) + dz * (r - q[6]);
            const float inverse = 1.0f / sqrtf(dx * dx + dy * dy + dz * dz);
            const float f = -(ks * (1.0f - rest[e] * inverse) + kd * along * inverse * inverse);
            fx += f * dx, fy += f * dy, fz += f * dz;
        }
        const float fall = w[i] > 0 ? g : 0, m = w[i];
        o[4] = u + h * m * fx, o[5] = v + h * (m * fy + fall), o[6] = r + h * m * fz;
        o[0] = x + h * o[4], o[1] = y + h * o[5], o[2] = z + h * o[6];
    }
}

// An even number of substeps: the result is in `a` again.
void frame(float *a, float *b, long n, const unsigned *start, const unsigned *neighbour, const float *rest,
           const float *w, int substeps, float ks, float kd, float h, float g) {
    for (int k = 0; k < substeps; k += 2) {
        step(a, b, n, start, neighbour, rest, w, ks, kd, h, g);
        step(b, a, n, start, neighbour, rest, w, ks, kd, h, g);
    }
}
