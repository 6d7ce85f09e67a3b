#include "apgm/observe/model.hpp"
