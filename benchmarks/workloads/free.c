// Free particles: gravity, drag, an attractor (mu may be 0), and a floor at y = 0.
#include <math.h>

#define TILE 256

typedef struct {
    float dt, g, k, restitution, eps, mu, cx, cy, cz, soft2;
} Numbers;

#define FLOOR                                        \
    int hit = (Y < eps) & (V < 0.0f);                \
    v[i] = hit ? -restitution * V : V;               \
    y[i] = hit && Y < 0.0f ? 0.0f : Y;               \
    x[i] = X, z[i] = Z, u[i] = U, w[i] = W;

static void euler(const Numbers *c, int n, float *restrict x, float *restrict y, float *restrict z,
                  float *restrict u, float *restrict v, float *restrict w) {
    const float h = c->dt, g = c->g, k = c->k, restitution = c->restitution, eps = c->eps;
#pragma omp simd
    for (int i = 0; i < n; i++) {
        float U = u[i] - h * k * u[i], V = v[i] + h * (g - k * v[i]), W = w[i] - h * k * w[i];
        float X = x[i] + h * U, Y = y[i] + h * V, Z = z[i] + h * W;
        FLOOR
    }
}

// The accelerations A, B, C of a particle at X, Y, Z with velocity U, V, W.
#define SLOPE(A, B, C, X, Y, Z, U, V, W)                                                                \
    float A, B, C;                                                                                      \
    {                                                                                                   \
        float dx = (X) - cx, dy = (Y) - cy, dz = (Z) - cz, r2 = dx * dx + dy * dy + dz * dz + soft2;    \
        float s = -mu / (r2 * sqrtf(r2));                                                               \
        A = s * dx - k * (U), B = s * dy + g - k * (V), C = s * dz - k * (W);                           \
    }

static void rk4(const Numbers *c, int n, float *restrict x, float *restrict y, float *restrict z,
                float *restrict u, float *restrict v, float *restrict w) {
    const float h = c->dt, g = c->g, k = c->k, restitution = c->restitution, eps = c->eps;
    const float mu = c->mu, cx = c->cx, cy = c->cy, cz = c->cz, soft2 = c->soft2, q = 0.5f * h, s6 = h / 6.0f;
#pragma omp simd
    for (int i = 0; i < n; i++) {
        float X = x[i], Y = y[i], Z = z[i], U = u[i], V = v[i], W = w[i];
        SLOPE(a1, b1, c1, X, Y, Z, U, V, W)
        float u2 = U + q * a1, v2 = V + q * b1, w2 = W + q * c1;
        SLOPE(a2, b2, c2, X + q * U, Y + q * V, Z + q * W, u2, v2, w2)
        float u3 = U + q * a2, v3 = V + q * b2, w3 = W + q * c2;
        SLOPE(a3, b3, c3, X + q * u2, Y + q * v2, Z + q * w2, u3, v3, w3)
        float u4 = U + h * a3, v4 = V + h * b3, w4 = W + h * c3;
        SLOPE(a4, b4, c4, X + h * u3, Y + h * v3, Z + h * w3, u4, v4, w4)
        X += s6 * (U + 2 * u2 + 2 * u3 + u4), Y += s6 * (V + 2 * v2 + 2 * v3 + v4);
        Z += s6 * (W + 2 * w2 + 2 * w3 + w4), U += s6 * (a1 + 2 * a2 + 2 * a3 + a4);
        V += s6 * (b1 + 2 * b2 + 2 * b3 + b4), W += s6 * (c1 + 2 * c2 + 2 * c3 + c4);
        FLOOR
    }
}

// s holds x, y, z, u, v, w one after another, n numbers each. fused: all substeps on a tile while it is in the cache.
void frame(float *s, long n, int substeps, int fused, int order4, const Numbers *c) {
    const int passes = fused ? 1 : substeps, inner = fused ? substeps : 1;
    for (int p = 0; p < passes; p++) {
#pragma omp parallel for schedule(static)
        for (long first = 0; first < n; first += TILE) {
            const int count = n - first < TILE ? (int)(n - first) : TILE;
            float *x = s + first;
            for (int k = 0; k < inner; k++)
                (order4 ? rk4 : euler)(c, count, x, x + n, x + 2 * n, x + 3 * n, x + 4 * n, x + 5 * n);
        }
    }
}
