#include "apgm/observe/ray.hpp"
