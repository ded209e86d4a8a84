#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "battery/calibrate.h"
#include "battery/recording.h"

namespace joulecast::battery {

// The conditions that the recordings of a calibration covered, and the errors to expect in the others. Rates
// are currents over the measured capacity [1/h].
struct Coverage {
  double slow_rate_1_h = 0;                      // of the slow discharge
  double least_rate_1_h = 0, most_rate_1_h = 0;  // largest currents of the other tests, least and most
  std::optional<std::pair<double, double>> temperature_c;  // lowest and highest; none: never measured
  double lowest_charge = 1;                                // under load
  bool charging = false;

  // The test with the highest rate, predicted by a calibration without it: the error at a rate that was not
  // tested. Empty where no test of a lower rate is left.
  struct FastestLeftOut {
    std::string name;
    double rate_1_h = 0, seen_to_1_h = 0;
    double time_error = 0, own_time_error = 0;        // as Prediction; own: with the test in the calibration
    double voltage_rms_v = 0, own_voltage_rms_v = 0;  // likewise
  };
  std::optional<FastestLeftOut> fastest_left_out;

  // A full discharge at `rate_1_h` at a temperature that was not tested: its duration over the duration in
  // the middle of the tested ones, by this battery, and by batteries with the least and the most activation
  // of usual cells.
  struct Temperature {
    double temperature_c = 0, rate_1_h = 0;
    double by_this = 1, least = 1, most = 1;
  };
  std::vector<Temperature> unseen_temperatures;
};

// `recordings` as given to calibrate(), which is called once more. Errors: those of the discharges that are
// tried.
Result<Coverage> coverage(const std::vector<Recording>& recordings, const Calibration& calibration,
                          const CalibrationOptions& options = {});

// One plain sentence for each gap: the condition that was not tested and the error to expect.
std::vector<std::string> sentences(const Coverage& coverage);

}  // namespace joulecast::battery
