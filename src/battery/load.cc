#include "battery/load.h"

#include <fmt/format.h>

#include <cmath>

#include "base/try.h"

namespace joulecast::battery {
namespace {

Result<void> check(std::span<const double> time_s, std::span<const double> value) {
  if (time_s.size() != value.size())
    return invalid(
        "value", fmt::format("has {} numbers, must have as many as time_s, {}", value.size(), time_s.size()));
  if (time_s.size() < 2) return invalid("time_s", fmt::format("has {} numbers, must have 2", time_s.size()));
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    if (!std::isfinite(value[i])) return invalid("value", fmt::format("is not finite at {}", i));
    if (!std::isfinite(time_s[i])) return invalid("time_s", fmt::format("is not finite at {}", i));
    if (i > 0 && !(time_s[i] > time_s[i - 1]))
      return invalid("time_s", fmt::format("is {} s at {}, must be after the one before, {} s", time_s[i], i,
                                           time_s[i - 1]));
  }
  return {};
}

}  // namespace

double Load::duration_s() const {
  double total = 0;
  for (const Piece& piece : pieces) total += piece.duration_s;
  return total;
}

Result<Load> held_load(Load::Kind kind, std::span<const double> time_s, std::span<const double> value) {
  TRY(check(time_s, value));
  Load load{kind, {}};
  for (std::size_t i = 1; i < time_s.size(); ++i)
    load.pieces.push_back({time_s[i] - time_s[i - 1], value[i], value[i]});
  return load;
}

}  // namespace joulecast::battery
