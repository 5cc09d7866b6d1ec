/*
 * Decodes in single precision, as fast as the compiler makes plain C: one pass over the frames without intermediate arrays, no branch, a
 * polynomial instead of atan2f. It has the results of the decoder: phase, modulation, and which pixels are rejected.
 *
 * For three geometric levels of four shifts of 8 bits. The compiler vectorises the loop with -fno-math-errno and -fno-trapping-math.
 */
#include <math.h>
#include <stddef.h>
#include <stdint.h>

enum { LEVELS = 3, FRAMES = 4 * LEVELS, FULL_SCALE = 255 };

static const float LEAST_MODULATION = 16.0f;
/* Largest residual of a level that is unwrapped, turns. */
static const float MAX_RESIDUAL = 0.40f;
/* Noise may move the coarsest phase below 0 by this many turns. */
static const float MARGIN = 0.03f;

/*
 * atan2(s, c) in turns, -1/2 to 1/2. The polynomial is that of M. Abramowitz, I. Stegun, Handbook of Mathematical Functions, 4.4.47,
 * divided by a turn: its error is below 2e-6 turns.
 */
static inline float turns(float s, float c) {
    const float as = fabsf(s), ac = fabsf(c);
    const float less = as < ac ? as : ac, more = as < ac ? ac : as;
    const float x = less / (more + 1e-20f), y = x * x;
    float t = x * (0.15913362f + y * (-0.05256880f + y * (0.02867033f + y * (-0.01354934f + y * 0.00331601f))));
    t = as > ac ? 0.25f - t : t;
    t = c < 0 ? 0.5f - t : t;
    return copysignf(t, s);
}

/*
 * frames: `pixels` samples of each frame, one frame after the other, the coarse level first; factor: ratio of a level to the one before
 * it; phase: turns of the finest level, NaN where rejected; modulation: that of the finest level, counts.
 */
void decode(const uint8_t *restrict frames, size_t pixels, float factor, float *restrict phase, float *restrict modulation) {
    for (size_t at = 0; at < pixels; at++) {
        float unwrapped = 0, amplitude = 0, least = INFINITY, residual = 0;
        uint8_t brightest = 0;
#pragma GCC unroll 3
        for (int level = 0; level < LEVELS; level++) {
            const uint8_t *shifts = frames + 4 * level * pixels + at;
            const uint8_t i0 = shifts[0], i1 = shifts[pixels], i2 = shifts[2 * pixels], i3 = shifts[3 * pixels];
            const uint8_t a = i0 > i1 ? i0 : i1, b = i2 > i3 ? i2 : i3, ab = a > b ? a : b;
            brightest = ab > brightest ? ab : brightest;
            const float s = (float)(i0 - i2), c = (float)(i1 - i3), wrapped = turns(s, c);
            amplitude = s * s + c * c;
            least = amplitude < least ? amplitude : least;
            if (level == 0) {
                unwrapped = wrapped - floorf(wrapped + MARGIN);
            } else {
                const float expected = unwrapped * factor - wrapped, order = rintf(expected);
                const float left = fabsf(expected - order);
                residual = left > residual ? left : residual;
                unwrapped = wrapped + order;
            }
        }
        unwrapped = least < 4 * LEAST_MODULATION * LEAST_MODULATION ? NAN : unwrapped;
        unwrapped = residual > MAX_RESIDUAL ? NAN : unwrapped;
        phase[at] = brightest == FULL_SCALE ? NAN : unwrapped;
        modulation[at] = 0.5f * sqrtf(amplitude);
    }
}
