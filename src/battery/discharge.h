#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "battery/circuit.h"
#include "battery/recording.h"

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
};

// value[i] holds over (time_s[i-1], time_s[i]]; value[0] is not used. Times strictly ascending, at least two,
// all finite; the error names the column.
Result<Load> held_load(Load::Kind kind, std::span<const double> time_s, std::span<const double> value);

// Where a discharge stops, besides the end of its load.
struct DischargeLimits {
  std::optional<double> voltage_v;  // default: the battery's cut-off
  double ambient_c = reference_temperature_c;
};

enum class Ending {
  load_ended,
  voltage,  // terminals fell to the voltage limit
  power     // the battery cannot deliver the requested power
};

struct Discharge {
  double duration_s = 0;
  Ending ending = Ending::load_ended;
  State state;                     // at the end
  double voltage_v = 0;            // terminals, at the end
  double charge_ah = 0;            // that left the terminals
  double energy_j = 0;             // that left the terminals
  std::vector<double> time_s;      // ends of the load's pieces, the last one cut short by the end
  std::vector<double> terminal_v;  // terminals there, just before the load changes
};

// Follows the circuit under the load with CVODE, restarted at each piece, and finds the end by its roots.
// The duration is the time to the ending. Errors: a non-finite start.
Result<Discharge> discharge(const Circuit& circuit, const State& start, const Load& load,
                            const DischargeLimits& limits = {});

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
