#include "apgm/observe/measurement.hpp"
