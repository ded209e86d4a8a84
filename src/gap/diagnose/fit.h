#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "gap/diagnose/explain.h"
#include "gap/diagnose/linear.h"

namespace joulecast::gap {

struct FitSettings {
  ExplainSettings explain;
  bool again = true;                 // made linear again where what was found puts it
  std::vector<double> shares{0.07};  // of the mean power, that an effect which is there may move
};

// Finds where on the floor something brakes, if anything does, by some of the blocks.
class ZoneScan {
 public:
  ZoneScan(const Material& material, std::span<const double> shares);

  std::optional<Zone> without(const std::vector<bool>& left_out) const;

 private:
  std::vector<Window> windows_;
  Linear linear_;
};

struct FitResult {
  Linear linear;
  Shapes shapes;
  std::optional<ZoneScan> zones;  // empty: no positions
  std::vector<Cause> causes;      // around which it rests
  // What every robot has (base_fit), where the file is so far off that all of it is estimated anew: then
  // everything else is sought beside it. Empty: not so.
  std::vector<Cause> base;
  std::vector<dynamics::ActiveEffect> in_force;  // of the robot file, and the base
  bool alone = false;                            // nothing is named beside the base
  double log_joint = 0;                          // of the best explanation, to compare starts by
};

// The material as a robot that has the base of a fit as well.
Material based(const Material& material, const FitResult& fit);

// Searches from `start`, linearises around what it finds, narrows shapes and searches again until the set and
// its strengths rest. Empty when `goes_on` returns false.
std::optional<FitResult> fit_windows(const Material& material, std::span<const Cause> start,
                                     const FitSettings& settings, const std::function<bool()>& goes_on);

}  // namespace joulecast::gap
