#pragma once

#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "answers/model.h"
#include "missions.h"
#include "planning/cost_table.h"

namespace joulecast::forecast {

// The parts of a planned mission that a request states.
enum class Asked {
  ways,      // turns, distances and arcs, with the payload
  dwells,    // and dwells
  stated,    // and how fast it drives and turns, ramps included
  one_path,  // as `ways`, all in one path
};
inline constexpr std::array<std::string_view, 4> asked_names{"ways", "ways, dwells", "all stated",
                                                             "one path"};

struct Told {
  std::array<double, 3> energy_j{};    // 5, 50 and 95 %
  std::array<double, 3> duration_s{};  // likewise
};

// Computes the autonomy of a robot with a full battery, as the daemon answers POST /v1/robots/{id}/autonomy.
class Asking {
 public:
  explicit Asking(const RobotRun& run);

  // Throws std::runtime_error with the answer's error.
  Told ask(const DrivenMission& mission, Asked asked, std::shared_ptr<const Forecaster> forecaster);

 private:
  answers::RobotOutlook outlook_;
  planning::CostTableCache tables_;
};

// Errors and hits of the forecasts of some missions.
struct Coverage {
  std::vector<double> energy_error, duration_error;    // relative, absolute
  std::size_t energy_inside = 0, duration_inside = 0;  // the 90 % interval
  std::size_t count() const { return energy_error.size(); }
};

// Learns the first missions of a robot, then forecasts all others and counts them.
void judge(const RobotRun& run, std::size_t learnt, Asked asked, Coverage& coverage);

// The least and most hits of so many 90 % intervals, of which at most (1 - share)/2 lie beyond either.
std::array<std::size_t, 2> expected_hits(std::size_t count, double share);

}  // namespace joulecast::forecast
