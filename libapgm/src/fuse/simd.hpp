#pragma once

/// APGM_CLONES: compiles a function for several instruction sets, picked when the program starts. All clones
/// give the same bytes: contraction is off, and no kernel reorders its sums.
///
/// Empty under sanitizers (the pick runs before their runtime is up), with other compilers and on other
/// machines.
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__gnu_linux__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && !defined(APGM_NO_CLONES)
#define APGM_CLONES __attribute__((target_clones("default", "avx2", "avx512f")))
#else
#define APGM_CLONES
#endif

#if defined(__GNUC__)
#define APGM_INLINE inline __attribute__((always_inline))
#else
#define APGM_INLINE inline
#endif

/// APGM_IVDEP, before a loop: its iterations do not depend on each other. Outputs may be inputs, at the same
/// index.
#if defined(__clang__)
#define APGM_IVDEP _Pragma("clang loop vectorize(assume_safety)")
#elif defined(__GNUC__)
#define APGM_IVDEP _Pragma("GCC ivdep")
#else
#define APGM_IVDEP
#endif
