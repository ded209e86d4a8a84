#pragma once

#include <cmath>
#include <functional>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "gap/diagnose/fit.h"

namespace joulecast::gap {

// Sums of |error| over the windows of one block whose power is known [W].
struct BlockErrors {
  double unchanged = 0;  // of the robot file's model
  double explained = 0;  // of what was found without the part that the block belongs to
  double spared = 0;  // how much of the last functions outside the catalogue that were found as well take off
  double referee = 0;  // of a plain regression without it
  double size = 0;     // of |power|
  // Sums of errors with their signs: what is missed of the block's energy.
  double unchanged_energy = 0, explained_energy = 0;
};

struct HeldOut {
  std::vector<BlockErrors> blocks;
  std::size_t parts = 0;
  std::vector<std::vector<std::string>> named;  // without each part
  std::vector<std::vector<Cause>> causes;       // and what was in force, the base of the fit first

  // Share of the fits without a part that name one of these.
  double found_again(const std::set<std::string>& ids) const;
  // Sum of an error over all blocks, over that of |power|; NaN where no power is known.
  double unchanged() const { return relative(&BlockErrors::unchanged); }
  double explained() const { return relative(&BlockErrors::explained); }
  double explained_with_functions() const { return explained() - relative(&BlockErrors::spared); }
  double referee() const { return relative(&BlockErrors::referee); }
  // Sum over blocks of what is missed of their energies, over that of |power|.
  double unchanged_energy() const {
    return relative([](const BlockErrors& b) { return std::fabs(b.unchanged_energy); });
  }
  double explained_energy() const {
    return relative([](const BlockErrors& b) { return std::fabs(b.explained_energy); });
  }
  // The same of what the energies differ by with what was found.
  double moved_energy() const {
    return relative([](const BlockErrors& b) { return std::fabs(b.unchanged_energy - b.explained_energy); });
  }

 private:
  double relative(const std::function<double(const BlockErrors&)>& error) const;
};

// Leaves out a part of the blocks at a time and does everything again without it: zone, noise, effects with
// their shapes, strengths; then predicts it. Only the point around which everything is linear stays.
// `power_w`: measured, of the windows. Empty when `goes_on` returns false.
std::optional<HeldOut> hold_out(const Material& material, const FitResult& fit,
                                std::span<const double> power_w, const FitSettings& settings,
                                const std::function<bool(double)>& goes_on);

// How much parts left out need a cause.
struct Need {
  double probability = 0;  // that they are predicted better with it than without, by how blocks differ
  double share = 0;        // of the power, that is missed without it and not with it, the others fitted again
};

// Of each cause of the base (FitResult::base).
std::vector<Need> base_needed(const Material& material, const FitResult& fit, const HeldOut& held,
                              std::span<const double> power_w);

// How much of the gap each named cause closes on held-out parts (Shapley), strengths fitted without each
// part; what else is estimated (FitResult::base) is there throughout. All are 0 where power was not measured;
// the first six share.
std::vector<double> held_out_shares(const Material& material, const FitResult& fit, const Problem& problem,
                                    const HypothesisSet& named, std::span<const double> power_w);

}  // namespace joulecast::gap
