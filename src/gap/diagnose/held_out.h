#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "gap/diagnose/fit.h"

namespace joulecast::gap {

// Sums of |error| over the windows of one block whose power is known [W].
struct BlockErrors {
  double unchanged = 0;  // of the robot file's model
  double explained = 0;  // of what was found without the part that the block belongs to
  double referee = 0;    // of a plain regression without it
  double size = 0;       // of |power|
};

struct HeldOut {
  std::vector<BlockErrors> blocks;
  std::size_t parts = 0;
  std::vector<std::vector<std::string>> named;  // without each part

  double unchanged() const { return relative(&BlockErrors::unchanged); }
  double explained() const { return relative(&BlockErrors::explained); }
  double referee() const { return relative(&BlockErrors::referee); }

 private:
  double relative(double BlockErrors::*error) const;
};

// Leaves out a part of the blocks at a time and does everything again without it: zone, noise, effects with their
// shapes, strengths; then predicts it. Only the point around which everything is linear stays. `power_w`: measured,
// of the windows. Empty when `goes_on` returns false.
std::optional<HeldOut> hold_out(const Material& material, const FitResult& fit, std::span<const double> power_w,
                                const FitSettings& settings, const std::function<bool(double)>& goes_on);

// Effects of an explanation that are named: those that are there, or one of their group, with even odds or better, by
// both judges, and that stand still.
HypothesisSet named_effects(const Problem& problem, const Explanation& explanation);

// The strengths with which these effects alone leave least where everything is linear, of all blocks not left out.
std::vector<dynamics::ActiveEffect> strengths_of(const ColumnSet& columns, const Problem& problem,
                                                 const HypothesisSet& named, const std::vector<bool>& left_out);

inline constexpr double least_named = 0.5;   // probability of a name
inline constexpr double most_wander = 0.8;   // of a strength, over the strength, that still is that effect
inline constexpr double steady_wander = 0.45;  // up to which it stands still

}  // namespace joulecast::gap
