#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "dynamics/drive_model.h"
#include "signals/ledger.h"
#include "signals/sample.h"

namespace joulecast::energy {

// The meter's accounts as one vector, so that one integration serves them all. Rates are in W, A or m/s.
namespace account {
inline constexpr std::size_t battery = 0;
inline constexpr std::size_t measured = 1;
inline constexpr std::size_t measured_motor = 2;  // two
inline constexpr std::size_t modelled = 4;
inline constexpr std::size_t modelled_motor = 5;  // two
inline constexpr std::size_t drawn = 7;
inline constexpr std::size_t returned = 8;
inline constexpr std::size_t charge_a = 9;
inline constexpr std::size_t distance = 10;
inline constexpr std::size_t turned = 11;
inline constexpr std::size_t ledger = 12;  // term_count
inline constexpr std::size_t count = ledger + signals::term_count;
}  // namespace account

using Rates = std::array<double, account::count>;

// Adds integrals of rates to the accounts; their durations are the caller's.
void book(std::span<const double, account::count> increment, signals::Accounts& accounts);

// Inputs of the rates at one instant; linear in time between samples.
struct Reading {
  dynamics::Instant motion;
  std::array<double, 2> motor_voltage_v{};
  std::array<double, 2> motor_current_a{};
  double battery_voltage_v = 0;
  double battery_current_a = 0;
};

// Which channels both ends of an interval have.
struct Coverage {
  bool battery = false;
  bool motors = false;
  bool operator==(const Coverage&) const = default;
};

// The reading of a sample; unmeasured electrical channels are zero (the coverage shows it).
Reading reading_of(const signals::Sample& sample, const std::array<double, 2>& wheel_acceleration_rad_s2,
                   double payload_kg, double climb_rad, const std::array<double, 2>& copper_heat_w);

// The reading at fraction s in [0, 1] between two. A channel unknown at either end is unknown in between.
Reading between(const Reading& a, const Reading& b, double s);

// All account rates at one instant. `copper_w` receives R i^2 of each motor [W].
Rates rates_at(const dynamics::DriveModel& model, const Reading& reading, Coverage coverage,
               std::array<double, 2>& copper_w);

}  // namespace joulecast::energy
