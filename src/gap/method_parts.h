#pragma once

#include "gap/windows.h"

namespace joulecast::gap {

// The parts of the method, so that a trial can leave one out and show what it is worth. A diagnosis in use
// has them all.
struct MethodParts {
  WindowSettings windows;
  bool whitening = true;   // false: every equation counts as independent, with one spread a channel
  bool scatter = true;     // false: all missions of a robot are alike
  bool tolerances = true;  // false: the robot is exactly as its file says
  bool open_set = true;    // false: nothing is outside the catalogue
};

}  // namespace joulecast::gap
