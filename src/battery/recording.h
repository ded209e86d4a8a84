#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace joulecast::battery {

// One test of a battery. Row i's current flowed since row i-1, and its voltage and temperature are those at
// its own time. Currents positive while discharging; temperature NaN where not measured.
struct Recording {
  std::string name;
  std::vector<double> time_s;  // ascending, at least two rows
  std::vector<double> current_a;
  std::vector<double> voltage_v;
  std::vector<double> temperature_c;

  std::size_t size() const { return time_s.size(); }
  double duration_s() const { return time_s.back() - time_s.front(); }
  double duration_s(std::size_t row) const { return time_s[row] - time_s[row - 1]; }  // row >= 1
  double charge_ah() const;                                                           // drawn in all
  Recording rows(std::ptrdiff_t first, std::ptrdiff_t end) const;
};

// Reads CSV with a header line that names t_s, I_A and V_V (or time_s, current_a, voltage_v and the like) and
// may name T_C (empty or nan: not measured) and cycle (each value a recording of its own); other columns are
// passed over. Of rows with the same time the last counts; a last line that breaks off does not. `name`
// begins the recordings' names. Errors name the line and the column.
Result<std::vector<Recording>> parse_recordings(std::string_view csv, const std::string& name);

// As parse_recordings; an unreadable file is Fault::not_found.
Result<std::vector<Recording>> read_recordings(const std::filesystem::path& path);

// A file itself; of a folder the tests in it; anything else is the beginning of the names of one battery's
// identification tests, <prefix>_*_data.csv, or where there are none <prefix>_*.csv without the random
// discharges <prefix>_rw.csv. Sorted.
Result<std::vector<std::filesystem::path>> identification_files(const std::string& file_or_prefix);

// The same for the discharges that test a calibrated battery: a file itself; of a folder or the beginning of
// the names of one battery's files its random discharges <prefix>_rw.csv.
Result<std::vector<std::filesystem::path>> discharge_files(const std::string& file_or_prefix);

}  // namespace joulecast::battery
