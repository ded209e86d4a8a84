#pragma once

#include <span>
#include <vector>

#include "base/error.h"

namespace joulecast::battery {

// The load of a battery over time: current [A] or power [W] at the terminals, positive discharging.
struct Load {
  enum class Kind { current, power };

  // The value runs linearly from `begin` to `end`.
  struct Piece {
    double duration_s;
    double begin;
    double end;
  };

  Kind kind = Kind::power;
  std::vector<Piece> pieces;

  double duration_s() const;
};

// value[i] holds over (time_s[i-1], time_s[i]]; value[0] is not used. Times strictly ascending, at least two,
// all finite; the error names the column.
Result<Load> held_load(Load::Kind kind, std::span<const double> time_s, std::span<const double> value);

}  // namespace joulecast::battery
