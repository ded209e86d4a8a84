#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "battery/recording.h"
#include "robot/robot_model.h"

namespace joulecast::battery {

struct CalibrationOptions {
  // Printed on the battery; the measured capacity becomes an ageing factor of it. Without it the measured
  // capacity is written to the file without an ageing factor.
  std::optional<double> rated_capacity_ah;
  double reserve_fraction = 0.15;
  // Called with the number of each step of the fit, some 10 to 60 of them.
  std::function<void(int)> on_step = {};
};

struct RecordingFit {
  std::string name;
  bool open_circuit = false;  // the slow discharge that gave the open-circuit voltage
  double voltage_rms_v = 0;   // of the fitted circuit with the measured temperature
};

// A recording without information on the circuit, and the reason.
struct PassedOver {
  std::string name;
  std::string reason;
};

// A fitted value at the bound of its search.
struct AtBound {
  std::string field;  // of the battery, as "/charge_lags/1/lag_s"
  double bound = 0;
};

struct Calibration {
  robot::Battery battery;
  std::vector<AtBound> at_bounds;
  std::vector<RecordingFit> recordings;
  std::vector<PassedOver> passed_over;
  int iterations = 0;
};

// Identifies one battery from tests that each begin fully charged and at rest: a slow full discharge (at most
// C/8; the slowest is taken as the open-circuit test), and constant-current and pulsed discharges. The slow
// one gives capacity and, corrected by the circuit's own drop, the open-circuit voltage. Of the others,
// resistance over charge, a branch, two charge lags and (where temperatures vary by 3 K) the activation are
// fitted by least squares on the voltage, each sample's error weighed as 0.135 % of the nominal voltage plus
// 0.2 % of the capacity along the curve, so that the steep end counts by its time rather than its volts.
// Thermal parameters follow from measured losses and temperatures. Recordings that draw no charge, or too
// little or too much of it, are passed over. Errors: no slow discharge, no other test.
Result<Calibration> calibrate(const std::vector<Recording>& given, const CalibrationOptions& options = {});

}  // namespace joulecast::battery
