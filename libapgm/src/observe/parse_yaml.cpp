#include "apgm/observe/profile.hpp"
