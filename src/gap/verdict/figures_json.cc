#include <ranges>

#include "gap/verdict/diagnosis_json.h"

namespace joulecast::gap {
namespace {

using described::Table;

// One member of each row.
template <class Owner, class Row, class Value>
auto of_rows(std::vector<Row> Owner::*rows, Value Row::*member) {
  return [rows, member](const Owner& owner) { return owner.*rows | std::views::transform(member); };
}

constexpr const char* before_words = "mean measured minus modelled power, by the robot file";
constexpr const char* after_words = "the same with the effects found";

const Table<Figures::Map>& map_table() {
  using Bin = Figures::Bin;
  const auto of = [](auto member) { return of_rows(&Figures::Map::bins, member); };
  static const auto table =
      Table<Figures::Map>()
          .value("axis", &Figures::Map::axis, "the variable")
          .all_digits("from", of(&Bin::from), "lower ends of its ranges")
          .all_digits("to", of(&Bin::to), "upper ends")
          .texts("label", of(&Bin::label), "names of phases")
          .all_digits("before_w", of(&Bin::before_w), before_words)
          .all_digits("after_w", of(&Bin::after_w), after_words)
          .all_digits("half_width_w", of(&Bin::half_width_w), "of a 95 % interval of before_w");
  return table;
}

const Table<Figures>& floor_table() {
  using F = Figures;
  using Cell = F::Cell;
  const auto of = [](auto member) { return of_rows(&F::floor, member); };
  static const auto table = Table<F>()
                                .number_or_null("cell_m", &F::cell_m, "side of a square")
                                .all_digits("x_m", of(&Cell::x_m), "lower corners")
                                .all_digits("y_m", of(&Cell::y_m), "lower corners")
                                .all_digits("before_w", of(&Cell::before_w), before_words)
                                .all_digits("after_w", of(&Cell::after_w), after_words)
                                .integers("windows", of(&Cell::windows), "number of readings");
  return table;
}

const Table<Figures>& power_table() {
  using F = Figures;
  using Point = F::Point;
  const auto of = [](auto member) { return of_rows(&F::power, member); };
  static const auto table = Table<F>()
                                .value("mission_id", &F::stretch_of, "the mission")
                                .all_digits("t_s", of(&Point::t_s), "time since its start")
                                .all_digits("measured_w", of(&Point::measured_w), "measured power")
                                .all_digits("before_w", of(&Point::before_w), "power by the robot file")
                                .all_digits("after_w", of(&Point::after_w), after_words);
  return table;
}

const Table<Figures>& mission_table() {
  using F = Figures;
  using M = F::Mission;
  const auto of = [](auto member) { return of_rows(&F::missions, member); };
  static const auto table =
      Table<F>()
          .texts("mission_id", of(&M::mission_id), "the robot's identifiers")
          .integers("start_utime_us", of(&M::start_utime_us), "starts, microseconds since 1970")
          .all_digits("length_s", of(&M::length_s), "durations")
          .all_digits("payload_kg", of(&M::payload_kg), "payloads")
          .all_digits("energy_before", of(&M::energy_before), "relative gap in energy, by the robot file")
          .all_digits("energy_after", of(&M::energy_after), after_words)
          .all_digits("power_before", of(&M::power_before), "relative gap in power, by the robot file")
          .all_digits("power_after", of(&M::power_after), after_words);
  return table;
}

}  // namespace

const Table<Figures>& figures_table() {
  using F = Figures;
  static const auto table =
      Table<F>()
          .list("maps", &F::maps, "power in ranges of one variable", map_table())
          .object("floor", std::identity(), "the same in squares of the floor", floor_table())
          .object("power", std::identity(), "power over the 90 s with the largest gap", power_table())
          .object("missions", std::identity(), "the first 40 missions", mission_table());
  return table;
}

}  // namespace joulecast::gap
