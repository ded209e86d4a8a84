#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "signals/sample.h"

namespace joulecast::signals {

// energy_state_t, free of LCM: the energy state that is sent to a robot. Energies in J since the mission
// began, leaving the battery positive; NaN: unknown.
struct EnergyState {
  std::int64_t utime_us = 0;
  std::string robot_id;
  std::string mission_id;  // empty: no mission open
  std::int64_t model_version = 0;
  double measured_power_w = unmeasured;
  double modelled_power_w = unmeasured;
  double measured_energy_j = unmeasured;
  double modelled_energy_j = unmeasured;
  double unexplained_energy_j = unmeasured;
  double recovered_energy_j = unmeasured;
  double state_of_charge = unmeasured;  // 0 to 1
  double state_of_charge_sd = unmeasured;
  double range_m = unmeasured;  // median
  std::array<double, 2> range_band_m{unmeasured, unmeasured};
  double run_time_s = unmeasured;  // median
  std::array<double, 2> run_time_band_s{unmeasured, unmeasured};
  std::array<double, 2> winding_temperature_c{unmeasured, unmeasured};
};

}  // namespace joulecast::signals
