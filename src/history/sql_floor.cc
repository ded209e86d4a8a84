// Traces summed by squares of the floor. Each query reads a bounded amount, however long the history.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/try.h"
#include "history/mission_days.h"
#include "history/sql_filter.h"
#include "history/sql_queries.h"

namespace joulecast::history {
namespace {

constexpr std::size_t missions_at_once = 32;
constexpr std::int64_t points_at_once = 50'000;

// Keys in a row are spread over the range as evenly as can be: multiples of the golden section
// (Knuth, The Art of Computer Programming 3, 6.4), so that robots that take turns are all in a share.
constexpr const char* spread_key = "(mission_key % 65536) * 40503 % 65536";
constexpr std::int64_t spread = 65536;

constexpr const char* points_of_mission = "((end_utime_us - start_utime_us) / 1000000 + 2)";

std::string conditions(const Where& where) {
  return where.sql() + " AND " + std::string(not_annulled) + " AND " + std::string(not_contradicted);
}

// Which missions are read for a map of the floor.
struct FloorChoice {
  struct Chosen {
    MissionKey key = 0;
    std::string robot_id;
    std::int64_t points = 0;  // at most
  };
  std::int64_t missions = 0;   // that match
  std::vector<Chosen> chosen;  // by key: all of them, or an even share that has at most so many points
};

struct Visits {
  std::vector<std::vector<FloorVisit>> by_mission;
  std::int64_t points = 0;
};

// One mission's sums while its points come.
class Sums {
 public:
  explicit Sums(double cell_m) : cell_m_(cell_m) {}

  void add(Rows& row) {
    const double covered_s = row.real(), measured_w = row.real(), modelled_w = row.real();
    const double speed_m_s = row.real(), x_m = row.real(), y_m = row.real();
    const double power_w = std::isnan(measured_w) ? modelled_w : measured_w;
    if (!(std::fabs(x_m) < farthest_floor_m && std::fabs(y_m) < farthest_floor_m && covered_s > 0)) return;
    if (std::isnan(power_w)) return;
    FloorVisit& visit = at(index(x_m), index(y_m));
    visit.covered_s += covered_s;
    visit.energy_j += power_w * covered_s;
    if (std::isnan(speed_m_s) || std::fabs(speed_m_s) < least_floor_speed_m_s) return;
    visit.distance_m += std::fabs(speed_m_s) * covered_s;
    visit.driving_j += power_w * covered_s;
    if (std::isnan(measured_w) || std::isnan(modelled_w)) return;
    visit.measured_j += measured_w * covered_s;
    visit.modelled_j += modelled_w * covered_s;
  }

  std::vector<FloorVisit> take() {
    places_.clear();
    return std::exchange(visits_, {});
  }

 private:
  std::int32_t index(double metre) const { return static_cast<std::int32_t>(std::floor(metre / cell_m_)); }

  FloorVisit& at(std::int32_t column, std::int32_t row) {
    const std::uint64_t place =
        std::uint64_t{static_cast<std::uint32_t>(column)} << 32 | static_cast<std::uint32_t>(row);
    const auto [found, is_new] = places_.try_emplace(place, visits_.size());
    if (is_new) visits_.push_back({{}, column, row});
    return visits_[found->second];
  }

  const double cell_m_;
  std::vector<FloorVisit> visits_;
  std::unordered_map<std::uint64_t, std::size_t> places_;
};

std::string select_points() {
  return "SELECT mission_key, covered_s, measured_power_mean_w, modelled_power_mean_w, speed_mean_m_s, "
         "x_m, y_m FROM trace WHERE " +
         among("mission_key", missions_at_once) +
         " AND x_m IS NOT NULL AND y_m IS NOT NULL ORDER BY mission_key";
}

Result<FloorChoice> floor_missions(Database& database, const MissionFilter& filter, std::int64_t max_points) {
  TRY(check_filter(filter));
  TRY(check_limit("max_points", max_points, max_floor_points));
  const Where where(filter);
  FloorChoice choice;
  std::int64_t points = 0;
  {
    const auto statement =
        database.prepare("SELECT count(*), CAST(coalesce(sum(" + std::string(points_of_mission) +
                         "), 0) AS BIGINT) FROM mission" + conditions(where));
    Rows rows(*statement);
    where.bind(rows);
    if (rows.next()) {
      choice.missions = rows.integer();
      points = rows.integer();
    }
  }
  // A share is even, but not to the point.
  const double share =
      points > max_points ? 0.95 * static_cast<double>(max_points) / static_cast<double>(points) : 1;
  const auto statement =
      database.prepare("SELECT mission_key, robot_id, " + std::string(points_of_mission) + " FROM mission" +
                       conditions(where) + " AND " + spread_key + " < ? ORDER BY mission_key");
  Rows rows(*statement);
  where.bind(rows);
  rows.bind(std::max<std::int64_t>(1, static_cast<std::int64_t>(share * static_cast<double>(spread))));
  std::int64_t left = max_points;
  while (rows.next()) {
    FloorChoice::Chosen next{.key = rows.integer(), .robot_id = rows.text()};
    next.points = rows.integer();
    if ((left -= next.points) < 0 && !choice.chosen.empty()) break;
    choice.chosen.push_back(std::move(next));
  }
  return choice;
}

// How many of the first are to be read in one query; 0 of none.
std::size_t next_at_once(std::span<const FloorChoice::Chosen> chosen) {
  std::size_t count = 0;
  std::int64_t points = 0;
  while (count < chosen.size() && count < missions_at_once &&
         (count == 0 || points + chosen[count].points <= points_at_once))
    points += chosen[count++].points;
  return count;
}

Result<Visits> read_visits(Database& database, std::span<const FloorChoice::Chosen> chosen, double cell_m) {
  Visits visits;
  visits.by_mission.resize(chosen.size());
  if (chosen.empty()) return visits;
  Rows rows(database, select_points());
  for (std::size_t k = 0; k < missions_at_once; ++k) rows.bind(chosen[std::min(k, chosen.size() - 1)].key);
  Sums mission(cell_m);
  std::size_t at = 0;
  while (rows.next()) {
    const MissionKey key = rows.integer();
    if (chosen[at].key != key) {
      visits.by_mission[at] = mission.take();
      while (chosen[at].key != key) ++at;
    }
    mission.add(rows);
    ++visits.points;
  }
  visits.by_mission[at] = mission.take();
  return visits;
}

}  // namespace

FloorSums& FloorSums::operator+=(const FloorSums& more) {
  covered_s += more.covered_s;
  distance_m += more.distance_m;
  energy_j += more.energy_j;
  driving_j += more.driving_j;
  measured_j += more.measured_j;
  modelled_j += more.modelled_j;
  return *this;
}

Result<FloorReading> Store::floor_visits(const MissionFilter& filter, double cell_m, std::int64_t max_points,
                                         const FloorSink& sink) const {
  if (!(cell_m >= least_floor_cell_m && cell_m <= greatest_floor_cell_m))
    return invalid("cell_m", "must be 0.1 to 100");
  TRY_ASSIGN(const auto choice,
             read([&](Database& database) { return floor_missions(database, filter, max_points); }));
  FloorReading reading{.missions = choice.missions};
  // Each part separately, so that a part read again after a lost connection reaches the sink once.
  for (std::span rest(choice.chosen); !rest.empty();) {
    const auto part = rest.first(next_at_once(rest));
    TRY_ASSIGN(const auto visits,
               read([&](Database& database) { return read_visits(database, part, cell_m); }));
    reading.points += visits.points;
    for (std::size_t k = 0; k < part.size(); ++k, ++reading.missions_read)
      if (!sink({part[k].key, part[k].robot_id, visits.by_mission[k]})) return reading;
    rest = rest.subspan(part.size());
  }
  return reading;
}

}  // namespace joulecast::history
