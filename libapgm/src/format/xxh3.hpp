#pragma once

// The one place where xxHash comes in. Its XXH3 functions become those that pick the machine's instructions
// at run time, where the library was built with them; the values are the same.
#include <xxhash.h>
#ifdef APGM_XXH_DISPATCH
#include <xxh_x86dispatch.h>
#endif
