#pragma once

#include <array>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"

// The energy model of Open-RMF (rmf_battery: SimpleMotionPowerSink, SimpleDevicePowerSink), fitted to
// missions: a drive takes mass |a| v + inertia |alpha| |omega| + friction mass g v, and the ambient power all
// the time. Braking costs as much as acceleration, turning at a constant rate nothing, payloads nothing.
namespace joulecast::client {

// The values of a fleet configuration that price a drive, in the units of the configuration.
struct RmfParameters {
  double voltage = 0;                                                  // V
  double capacity = 0;                                                 // Ah
  double charging_current = std::numeric_limits<double>::quiet_NaN();  // A; NaN: unknown
  double mass = 0;                                                     // kg
  double moment_of_inertia = 0;                                        // kg m²
  double friction_coefficient = 0;
  double ambient_power = 0;  // W
  double tool_power = 0;     // W
};

// A drive from one halt to the next, and that halt.
struct RmfDrive {
  double energy_j = 0;
  double charge_c = 0;
  double duration_s = 0;
  double distance_m = 0;
  double turn_rad = 0;
  double speeding = 0;  // integral of |a| v, m²/s²
  double swerving = 0;  // integral of |alpha| |omega|, rad²/s²
};

// Columns of a mission; NaN where not measured. Speeds are those of the wheels, right and left.
struct RmfTelemetry {
  std::vector<double> time_s;
  std::array<std::vector<double>, 2> wheel_rad_s;
  std::vector<double> voltage_v, current_a;
};

// The drives of a mission; those during which the battery or a wheel was not measured are left out.
[[nodiscard]] std::vector<RmfDrive> rmf_drives(const RmfTelemetry& telemetry, double wheel_radius_m,
                                               double half_track_m);

// Errors of the energy of missions, relative to the measured energy.
struct RmfError {
  double absolute = 0;  // mean absolute value
  double bias = 0;      // mean
};

// Where a value stands in a configuration.
struct RmfPlace {
  const char* section;
  const char* key;
  const char* unit;
  double RmfParameters::*value;
};
// In the order of the configurations of RMF's demonstrations.
[[nodiscard]] const std::vector<RmfPlace>& rmf_places();

struct RmfFit {
  RmfParameters parameters;
  std::size_t fitted = 0;    // missions that it is fitted to
  std::size_t held_out = 0;  // every third, for the errors
  RmfError error;
  RmfError error_with_turns;  // with a term in proportion to the angle turned, which RMF's model lacks
  double turn_j_per_rad = 0;  // the coefficient of that term
  std::optional<RmfError> error_before;  // of `before` on the same missions
};

// Least squares with coefficients of at least zero, the energy of each drive weighted by one over its
// duration. `capacity_ah`: the robot file's; the voltage is energy over charge. Error: fewer than 6 missions.
[[nodiscard]] Result<RmfFit> fit_rmf(const std::vector<std::vector<RmfDrive>>& missions, double capacity_ah,
                                     const std::optional<RmfParameters>& before);

// The values of a fleet configuration in YAML. Error: one is missing, or no number on a line of its own.
[[nodiscard]] Result<RmfParameters> read_rmf_configuration(const std::string& yaml);

// The configuration with the values replaced, comments kept. An unknown charging current stays.
[[nodiscard]] std::string with_rmf_parameters(const std::string& yaml, const RmfParameters& parameters);

}  // namespace joulecast::client
