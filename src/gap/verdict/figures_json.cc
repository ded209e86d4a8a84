#include <initializer_list>
#include <ranges>

#include "gap/verdict/diagnosis_json.h"

namespace joulecast::gap {
namespace {

using described::Table;

// A member of rows.
template <class Row>
struct FigureColumn {
  const char* name;
  std::variant<double Row::*, std::string Row::*, std::int64_t Row::*, std::size_t Row::*> member;
  const char* words;
};

// Adds an array for each column of the rows.
template <class Owner, class Row>
Table<Owner> with_columns(Table<Owner> table, std::vector<Row> Owner::*rows,
                          std::initializer_list<FigureColumn<Row>> columns) {
  for (const FigureColumn<Row>& column : columns) {
    const auto add = [&]<class Value>(Value Row::*member) {
      const auto get = [=](const Owner& owner) { return owner.*rows | std::views::transform(member); };
      if constexpr (std::is_same_v<Value, double>)
        table.all_digits(column.name, get, column.words);
      else if constexpr (std::is_same_v<Value, std::string>)
        table.texts(column.name, get, column.words);
      else
        table.integers(column.name, get, column.words);
    };
    std::visit(add, column.member);
  }
  return table;
}

constexpr const char* before_words = "mean measured minus modelled power, by the robot file";
constexpr const char* after_words = "the same with the effects found";

}  // namespace

const Table<Figures>& figures_table() {
  using F = Figures;
  using Bin = F::Bin;
  static const auto maps =
      with_columns(Table<F::Map>().value("axis", &F::Map::axis, "the variable"), &F::Map::bins,
                   {{"from", &Bin::from, "lower ends of its ranges"},
                    {"to", &Bin::to, "upper ends"},
                    {"label", &Bin::label, "names of phases"},
                    {"before_w", &Bin::before_w, before_words},
                    {"after_w", &Bin::after_w, after_words},
                    {"half_width_w", &Bin::half_width_w, "of a 95 % interval of before_w"}});
  static const auto floor =
      with_columns(Table<F>().number_or_null("cell_m", &F::cell_m, "side of a square"), &F::floor,
                   {{"x_m", &Bin::from, "lower corners"},
                    {"y_m", &Bin::to, "lower corners"},
                    {"before_w", &Bin::before_w, before_words},
                    {"after_w", &Bin::after_w, after_words},
                    {"windows", &Bin::windows, "number of readings"}});
  using Point = F::Point;
  static const auto power =
      with_columns(Table<F>().value("mission_id", &F::stretch_of, "the mission"), &F::power,
                   {{"t_s", &Point::t_s, "time since its start"},
                    {"measured_w", &Point::measured_w, "measured power"},
                    {"before_w", &Point::before_w, "power by the robot file"},
                    {"after_w", &Point::after_w, after_words}});
  using M = F::Mission;
  static const auto missions =
      with_columns(Table<F>(), &F::missions,
                   {{"mission_id", &M::mission_id, "the robot's identifiers"},
                    {"start_utime_us", &M::start_utime_us, "starts, microseconds since 1970"},
                    {"length_s", &M::length_s, "durations"},
                    {"payload_kg", &M::payload_kg, "payloads"},
                    {"energy_before", &M::energy_before, "relative gap in energy, by the robot file"},
                    {"energy_after", &M::energy_after, after_words},
                    {"power_before", &M::power_before, "relative gap in power, by the robot file"},
                    {"power_after", &M::power_after, after_words}});
  static const auto table =
      Table<F>()
          .list("maps", &F::maps, "power in ranges of one variable", maps)
          .object("floor", std::identity(), "the same by floor square", floor)
          .object("power", std::identity(), "power over the 90 s with the largest gap", power)
          .object("missions", std::identity(), "the first 40 missions", missions);
  return table;
}

}  // namespace joulecast::gap
