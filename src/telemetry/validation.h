#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "signals/covariates.h"
#include "signals/sample.h"

namespace joulecast::telemetry {

// The widest value that a ground robot of any size could report, of every field in one table. Outside lies a
// unit mistake or a broken sensor, not a robot; limits of a particular robot belong to its model.
struct PlausibleRange {
  std::string_view field;  // name in robot_telemetry_t
  double low = 0;
  double high = 0;
};

[[nodiscard]] std::span<const PlausibleRange> plausible_ranges() noexcept;

inline constexpr std::int64_t year_2200_us = 7'258'118'400'000'000;  // from which on no clock is right

enum class Implausibility {
  missing,       // NaN in wheel_velocity, the one channel that every robot must measure
  infinite,      // an infinity, in any field
  out_of_range,  // beyond plausible_ranges(); of a label neither 0 nor 1
  bad_clock,     // utime before 1970 or after 2200
  bad_sequence   // negative sequence number
};

struct Implausible {
  Implausibility why = Implausibility::missing;
  std::string_view field;  // name in robot_telemetry_t
  double value = 0;
};

// The fault of the sample on its own; empty if it is plausible.
[[nodiscard]] std::optional<Implausible> check_plausible(const signals::Sample& sample) noexcept;
[[nodiscard]] std::optional<Implausible> check_plausible(const signals::MissionEvent& event) noexcept;
// Of the message its clock; of each value that it is finite or NaN, of a label's 0, 1 or NaN.
[[nodiscard]] std::optional<Implausible> check_plausible(const signals::CovariateMessage& message) noexcept;
[[nodiscard]] std::optional<Implausible> check_plausible(const signals::Covariate& covariate) noexcept;
[[nodiscard]] std::string describe(const Implausible& fault);

}  // namespace joulecast::telemetry
