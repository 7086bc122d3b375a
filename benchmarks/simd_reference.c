/* Reference for the lane kernel: RK4 of one group of W parameter vectors per call, in GCC vector extensions.
 *
 * Written by hand: memory layout, stage loop, sine and cosine, and (BODY_HAND) the equations of the planar
 * generic submarine with only the rows that are not zero. BODY_FILE brings the equations of the term table with
 * every row, printed as C by simd.py from the same graph the numba kernels come from.
 */
#include <immintrin.h>
#include <string.h>

typedef double vd __attribute__((vector_size(8 * W)));
typedef long long vi __attribute__((vector_size(8 * W)));

#define SPLAT(x) ((vd){} + (x))
static inline vd vabs(vd x) { return (vd)((vi)x & 0x7fffffffffffffffLL); }
static inline vd pick(vi mask, vd a, vd b) { return (vd)(((vi)a & mask) | ((vi)b & ~mask)); }
static inline vd vstep(vd x) { return (vd)((vi)(x > 0.0) & (vi)SPLAT(1.0)); }
static inline vd vsgn(vd x) { return vstep(x) - vstep(-x); }
static inline vd vsqrt(vd x) {
#if W == 8
    return (vd)_mm512_sqrt_pd((__m512d)x);
#else
    return (vd)_mm256_sqrt_pd((__m256d)x);
#endif
}

static inline vd vmin(vd a, vd b) { return pick((vi)(a < b), a, b); }
static inline vd vmax(vd a, vd b) { return pick((vi)(a > b), a, b); }
static inline vd vrsqrt(vd x) { return 1.0 / vsqrt(vmax(x, SPLAT(1e-60))); }

/* Cody-Waite reduction by the round-to-nearest shift, Cephes polynomials, quadrant from the shifted mantissa. */
static inline void vsincos(vd a, vd *s, vd *c) {
    const double shift = 6755399441055744.0;
    vd shifted = a * 0.6366197723675814 + shift;
    vi q = (vi)shifted;
    vd k = shifted - shift;
    vd y = ((a - k * 1.57079625129699707031) - k * 7.54978941586159635335e-08) - k * 5.39030285815811905290e-15;
    vd z = y * y;
    vd ps = ((((1.58962301576546568060e-10 * z - 2.50507477628578072866e-8) * z + 2.75573136213857245213e-6) * z
              - 1.98412698295895385996e-4) * z + 8.33333333332211858878e-3) * z - 1.66666666666666307295e-1;
    vd pc = ((((-1.13585365213876817300e-11 * z + 2.08757008419747316778e-9) * z - 2.75573141792967388112e-7) * z
              + 2.48015872888517045348e-5) * z - 1.38888888888730564116e-3) * z + 4.16666666666665929218e-2;
    ps = y + y * z * ps;
    pc = 1.0 - 0.5 * z + z * z * pc;
    vi odd = -(q & 1);
    vd s0 = pick(odd, pc, ps), c0 = pick(odd, ps, pc);
    *s = (vd)((vi)s0 ^ ((q & 2) << 62));
    *c = (vd)((vi)c0 ^ (((q + 1) & 2) << 62));
}

#define P(i) par[i]
static void rate(const vd *par, const vd *minv, const vd *x, const double *u, const double *e, double t, vd *k) {
#ifdef BODY_FILE
#include BODY_FILE
#else
    /* 22 coefficients of the set, three propulsion rows, mass and r_G = 0: P(i) in the order of simd.HAND */
    vd sn, cs;
    vsincos(x[2], &sn, &cs);
    vd U = x[3], v = x[4], r = x[5], av = vabs(v), ar = vabs(r);
    double dr = u[0], n = u[1];
    vd uu = U * U, uv = U * v, ur = U * r, vr = v * r, vav = v * av, uar = U * ar, m = P(0);
    vd f0 = P(1) * r * r + P(2) * vr + P(3) * v * v + P(4) * (dr * dr) * uu + P(5) * U * vabs(U) + P(6) * U * n
            + P(7) * (n * n) + m * vr;
    vd f1 = P(8) * ur + P(9) * uar * dr + P(10) * v * ar + P(11) * uv + P(12) * vav + P(13) * uu * dr - m * ur;
    vd f2 = P(14) * r * ar + P(15) * ur + P(16) * uar * dr + P(17) * av * r + P(18) * uv + P(19) * vav
            + P(20) * uu * dr;
    k[0] = U * cs - v * sn;
    k[1] = U * sn + v * cs;
    k[2] = r;
    k[3] = minv[0] * f0 + minv[1] * f1 + minv[2] * f2;
    k[4] = minv[3] * f0 + minv[4] * f1 + minv[5] * f2;
    k[5] = minv[6] * f0 + minv[7] * f1 + minv[8] * f2;
    (void)e;
    (void)t;
#endif
}

static void group(const vd *par, const vd *minv, const vd *start, int steps, const double *times, const double *h,
                  const double *act, const double *exo, vd *out) {
    vd x[NX], z[NX], k[NX], q[NX];
    memcpy(x, start, sizeof x);
    memcpy(out, x, sizeof x);
    for (int s = 0; s < steps; s++) {
        const double *u = act + s * NA, *e = exo + s * NE, hs = h[s];
        rate(par, minv, x, u, e, times[s], k);
        for (int i = 0; i < NX; i++) { q[i] = k[i]; z[i] = x[i] + 0.5 * hs * k[i]; }
        rate(par, minv, z, u, e, times[s] + 0.5 * hs, k);
        for (int i = 0; i < NX; i++) { q[i] += 2.0 * k[i]; z[i] = x[i] + 0.5 * hs * k[i]; }
        rate(par, minv, z, u, e, times[s] + 0.5 * hs, k);
        for (int i = 0; i < NX; i++) { q[i] += 2.0 * k[i]; z[i] = x[i] + hs * k[i]; }
        rate(par, minv, z, u, e, times[s] + hs, k);
        for (int i = 0; i < NX; i++) x[i] += hs / 6.0 * (q[i] + k[i]);
        memcpy(out + (s + 1) * NX, x, sizeof x);
    }
}

void run(int groups, const double *par, const double *minv, const double *start, int steps, const double *times,
         const double *h, const double *act, const double *exo, double *out, int threads) {
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int g = 0; g < groups; g++)
        group((const vd *)par + (long)g * NP, (const vd *)minv + (long)g * NM, (const vd *)start + (long)g * NX, steps,
              times, h, act, exo, (vd *)out + (long)g * (steps + 1) * NX);
}
