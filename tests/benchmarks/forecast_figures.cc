// Accuracy of forecasts, queried like a daemon, in dissimilar worlds: a fleet recorded from another plant,
// and virtual robots of several habits with plants that share no physics with the model and have two to four
// effects outside it. The first missions of a robot are used for training, the others are forecast.
//
//   forecast_figures [robots of each virtual kind = 2] [first seed = 90000] [habit, of all = -1]
//   forecast_figures foreign [kinds = 8] [first seed = 1]
//
// The second prints the coverage by what a request states, of robots of a plant that shares no equation with
// the product (tests/forecast/foreign_coverage.h), and the share of budgets that held by the stated
// probability. It takes about 7 s of CPU per kind.
//
// Prints the coverage of the 90 % interval and the binomial's 95 % interval of it. The recorded robots are
// also run with their missions in other orders, as twenty missions in one order give little evidence;
// repeated missions are not independent, so that interval is too narrow. Takes about 0.1 s of CPU per
// mission.
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <string>
#include <utility>

#include "asking.h"
#include "base/median.h"
#include "foreign_coverage.h"
#include "virtual_missions.h"

namespace joulecast::forecast {
namespace {

constexpr std::size_t learnt = 30, missions = 45;
constexpr unsigned orders = 30;
using Table = std::array<Coverage, asked_names.size()>;

void print(const std::string& world, const Table& table) {
  for (std::size_t k = 0; k < table.size(); ++k) {
    const Coverage& c = table[k];
    if (c.count() == 0) continue;
    const auto hits = expected_hits(c.count(), 0.95);
    const auto percent = [&](std::size_t part) {
      return 100 * static_cast<double>(part) / static_cast<double>(c.count());
    };
    std::printf("%-24s %-13s %5zu %8.2f%% %7.1f%% %9.2f%%", world.c_str(), asked_names[k].data(), c.count(),
                100 * upper_median(c.energy_error), percent(c.energy_inside),
                100 * upper_median(c.duration_error));
    // A plan that states every parameter has one duration.
    if (static_cast<Asked>(k) == Asked::stated)
      std::printf(" %8s", "-");
    else
      std::printf(" %7.1f%%", percent(c.duration_inside));
    std::printf("   %3.0f to %3.0f %%\n", percent(hits[0]), percent(hits[1]));
  }
  std::fflush(stdout);
}

void count(const RobotRun& run, std::size_t first, Table& table) {
  for (std::size_t k = 0; k < table.size(); ++k) judge(run, first, static_cast<Asked>(k), table[k]);
}

void virtual_worlds(int each, std::uint64_t seed, int only) {
  for (std::size_t h = 0; h < virtual_habits().size(); ++h) {
    if (only >= 0 && static_cast<std::size_t>(only) != h) continue;
    const VirtualHabit& habit = virtual_habits()[h];
    Table table;
    std::uint64_t own = seed + 100 * h;
    for (int k = 0; k < each; ++k)
      for (const char* kind : {"amr", "nomad", "p3dx", "tug"})
        count(run_virtual_robot(kind, missions, own++, true, habit), learnt, table);
    print(std::string("virtual: ") + habit.name, table);
  }
}

void recorded_worlds() {
  const std::string data = JOULECAST_SHARED "/data/";
  for (const char* robot : {"amr", "tug"}) {
    auto run = recorded_fleet_robot(data + "fleets/" + robot);
    if (!run) continue;
    Table in_order, shuffled;
    count(*run, learnt, in_order);
    print(std::string("another plant's ") + robot, in_order);
    for (unsigned order = 0; order < orders; ++order) {
      std::shuffle(run->missions.begin(), run->missions.end(), std::mt19937(order));
      count(*run, learnt, shuffled);
    }
    print("  in other orders", shuffled);
  }
}

void foreign_rows(std::uint64_t seed, std::size_t kinds) {
  const ForeignCoverage coverage = foreign_coverage(seed, kinds);
  std::printf("%-32s %5s %9s %8s %8s %10s %8s\n", "stated", "n", "energy", "in 90 %", "width", "duration",
              "in 90 %");
  for (const auto& [name, row] : coverage.rows) {
    const auto percent = [&, n = static_cast<double>(row.count())](std::size_t part) {
      return 100 * static_cast<double>(part) / n;
    };
    std::printf("%-32s %5zu %+8.1f%% %7.1f%% %7.2f%% %+9.1f%% %7.1f%%\n", name.c_str(), row.count(),
                100 * upper_median(row.energy_error), percent(row.energy_inside),
                100 * row.energy_width / static_cast<double>(row.count()),
                100 * upper_median(row.duration_error), percent(row.duration_inside));
  }
  for (const auto& [title, all] : {std::pair("from five missions on", coverage.known),
                                   {"fewer missions, first payloads", coverage.little_known}}) {
    std::printf("\n%s\n%-12s %-12s %s\n", title, "probability", "held", "n");
    for (const StatedChances& chances : all) {
      const auto n = static_cast<double>(std::max<std::size_t>(1, chances.count));
      std::printf("%-12.2f %-12.2f %zu\n", chances.sum / n, static_cast<double>(chances.held) / n,
                  chances.count);
    }
  }
}

}  // namespace
}  // namespace joulecast::forecast

int main(int count, char** arguments) {
  const auto number = [&](int index, int fallback) {
    return index < count ? std::atoi(arguments[index]) : fallback;
  };
  if (number(1, 2) == 0) {
    joulecast::forecast::foreign_rows(static_cast<std::uint64_t>(number(3, 1)),
                                      static_cast<std::size_t>(number(2, 8)));
    return 0;
  }
  std::printf("%-24s %-13s %5s %9s %8s %10s %8s   %s\n", "world", "asked", "n", "energy", "in 90 %",
              "duration", "in 90 %", "of a binomial");
  if (number(3, -1) < 0) joulecast::forecast::recorded_worlds();
  joulecast::forecast::virtual_worlds(number(1, 2), static_cast<std::uint64_t>(number(2, 90'000)),
                                      number(3, -1));
}
