#pragma once

#include <string>
#include <vector>

#include "base/error.h"
#include "battery/circuit.h"
#include "battery/discharge.h"
#include "battery/recording.h"

namespace joulecast::battery {

// One recorded discharge compared with the circuit's prediction. The circuit is given only the profile of
// current or power, the temperature at the start, and that the battery was full and rested then.
struct Prediction {
  std::string name;
  double end_voltage_v = 0;  // the cut-off, or the last recorded voltage where that is above it
  double measured_s = 0;     // until the recording reaches end_voltage_v
  double predicted_s = 0;    // until the circuit's terminals reach end_voltage_v; the last load goes on
  double time_error = 0;     // predicted / measured - 1
  // Over the rows above least_charge: of the charge that this discharge delivered, and of the battery's
  // capacity, which a fast discharge leaves in part (so that it reaches further into the steep end).
  double voltage_rms_v = 0;
  double voltage_rms_by_capacity_v = 0;
};

struct PredictionSummary {
  std::size_t count = 0;
  double time_error_median = 0;  // of absolute values
  double time_error_p95 = 0;
  double voltage_rms_v = 0;  // root mean square of the discharges' own, here and below
  double voltage_rms_by_capacity_v = 0;
  double voltage_rms_worst_v = 0;
};

inline constexpr double least_charge = 0.1;

// Errors: the recording draws nothing, or the circuit does not reach the end voltage in twice the time.
Result<Prediction> predict(const Circuit& circuit, const Recording& recording, Load::Kind from);

PredictionSummary summarise(const std::vector<Prediction>& predictions);

}  // namespace joulecast::battery
