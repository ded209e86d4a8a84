#include "telemetry/import_series.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "telemetry/import_cells.h"

namespace joulecast::telemetry {

std::string_view name_of(OutsidePolicy policy) noexcept {
  switch (policy) {
    case OutsidePolicy::hold:
      return "hold";
    case OutsidePolicy::clamp:
      return "clamp";
    case OutsidePolicy::blank:
      return "unmeasured";
    case OutsidePolicy::drop_row:
      return "drop_row";
  }
  return "";
}

Result<std::size_t> place_of(const CsvTable& table, const TableLayout& layout, const std::string& column,
                             const std::string& source) {
  auto place = table.find(column);
  if (!place && !layout.column_prefix.empty()) place = table.find(layout.column_prefix + column);
  if (!place) return fail(Fault::invalid, source + ": line 1", "column '" + column + "' is missing");
  return *place;
}

Result<TableSeries> TableSeries::read(std::string_view csv, const TableLayout& layout,
                                      std::vector<SeriesColumn> columns, const std::string& source,
                                      const std::string& shown, std::vector<Glitch>& glitches) {
  const auto located = [&](Error error) {
    error.field = source + ": " + error.field;
    return tl::unexpected(std::move(error));
  };
  auto table = CsvTable::open(csv, layout.format);
  if (!table) return located(std::move(table.error()));
  const auto time_place = place_of(*table, layout, layout.time_column, source);
  if (!time_place) return tl::unexpected(time_place.error());
  TableSeries series;
  std::vector<std::size_t> places;
  for (const SeriesColumn& column : columns) {
    const auto place = place_of(*table, layout, column.name, source);
    if (!place) return tl::unexpected(place.error());
    places.push_back(*place);
    series.columns_.push_back({column.interpolation, {}});
  }
  std::vector<std::string_view> row;
  std::int64_t last_us = INT64_MIN;
  while (true) {
    auto more = table->next(row);
    if (!more) return located(std::move(more.error()));
    if (!*more) break;
    const auto refuse = [&](const std::string& column, std::string_view text, const char* what) {
      return fail(
          Fault::corrupt, source + ": line " + std::to_string(table->line()),
          "column '" + column + "': '" + std::string(text) + "' " + what + decimal_hint(text, layout));
    };
    const std::string_view stamp = trimmed(row[*time_place]);
    const auto since_zero_us = parse_time_us(stamp, layout);
    std::int64_t utime_us = 0;
    if (!since_zero_us || __builtin_add_overflow(*since_zero_us, layout.epoch_us, &utime_us))
      return refuse(layout.time_column, stamp, "is no time");
    ++series.rows_;
    series.rows_unsorted_ += utime_us <= last_us;
    last_us = std::max(last_us, utime_us);
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const std::string_view text = trimmed(row[places[k]]);
      if (text.empty()) continue;
      const auto value = parse_number(text, layout.decimal_comma);
      if (!value) return refuse(columns[k].name, text, "is no number");
      if (std::isnan(*value)) continue;
      double reading = *value;
      const ValueLimits* limits = columns[k].limits;
      if (!std::isfinite(reading) ||
          (limits != nullptr && !(reading >= limits->low && reading <= limits->high))) {
        const OutsidePolicy policy = limits != nullptr ? limits->outside : OutsidePolicy::blank;
        glitches.push_back({table->line(), shown + columns[k].name, reading, std::string(name_of(policy))});
        if (policy != OutsidePolicy::clamp) continue;
        reading = std::clamp(reading, limits->low, limits->high);
      }
      series.columns_[k].points.push_back({utime_us, reading});
    }
  }
  for (Column& column : series.columns_) std::ranges::stable_sort(column.points, {}, &Point::utime_us);
  return series;
}

void TableSeries::shift(std::int64_t by_us) {
  for (Column& column : columns_)
    for (Point& point : column.points) point.utime_us += by_us;
}

TableSeries::Reading TableSeries::at(std::size_t column, std::int64_t utime_us,
                                     std::int64_t tolerance_us) const {
  const auto& [interpolation, points] = columns_[column];
  const auto next = std::ranges::upper_bound(points, utime_us, {}, &Point::utime_us);
  if (next == points.begin()) return {signals::unmeasured, 0, !points.empty()};
  const Point& before = *(next - 1);
  const std::int64_t age_us = utime_us - before.utime_us;
  if (interpolation == Interpolation::hold || age_us == 0)
    return age_us <= tolerance_us ? Reading{before.value, age_us, false}
                                  : Reading{signals::unmeasured, age_us, true};
  if (next == points.end() || next->utime_us - before.utime_us > tolerance_us)
    return {signals::unmeasured, age_us, true};
  const double share = static_cast<double>(age_us) / static_cast<double>(next->utime_us - before.utime_us);
  return {before.value + share * (next->value - before.value), std::min(age_us, next->utime_us - utime_us),
          false};
}

}  // namespace joulecast::telemetry
