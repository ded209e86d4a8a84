#include "client/profile_drawing.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "base/json_number.h"
#include "report/profile_drawing.h"

namespace joulecast::client {
namespace {

using Json = nlohmann::json;

std::vector<double> column(const Json& object, const char* name) {
  std::vector<double> values;
  const auto found = object.find(name);
  if (found == object.end() || !found->is_array()) return values;
  for (const Json& value : *found) values.push_back(value.is_number() ? value.get<double>() : std::nan(""));
  return values;
}

std::optional<report::DrawnMotion> motion_of(const Json& holder, std::string label, std::string_view style) {
  if (!holder.is_object()) return std::nullopt;
  const auto found = holder.find("profile");
  if (found == holder.end() || !found->is_object()) return std::nullopt;
  report::DrawnMotion m{std::move(label),
                        style,
                        column(*found, "time_s"),
                        column(*found, "speed_m_s"),
                        column(*found, "yaw_rate_rad_s"),
                        column(*found, "power_w"),
                        column(*found, "energy_j")};
  const std::size_t n = m.time_s.size();
  if (n < 2 || m.speed_m_s.size() != n || m.yaw_rate_rad_s.size() != n || m.power_w.size() != n ||
      m.energy_j.size() != n)
    return std::nullopt;
  return m;
}

std::string baseline_label(const char* name, const Json& baseline) {
  return fmt::format("{}, as long on every run: {:.1f} J; the plan saves {:.1f} %{}", name,
                     number_at(baseline, "energy_j"), 100 * number_at(baseline, "saving_fraction"),
                     baseline.value("within_limits", true) ? "" : " (breaks the robot's limits)");
}

}  // namespace

Result<std::string> draw_answer(const Json& answer) {
  const auto baselines = answer.find("baselines");
  const bool planned = baselines != answer.end() && baselines->is_object();
  auto own = motion_of(
      answer, fmt::format("{}: {:.1f} J", planned ? "least energy" : "motion", number_at(answer, "energy_j")),
      "plan");
  if (!own) return fail(Fault::corrupt, "profile", "the answer has no columns to draw");
  std::vector<report::DrawnMotion> motions{std::move(*own)};
  for (const char* name : {"trapezoid", "triangle"}) {
    if (!planned || !baselines->contains(name)) continue;
    const Json& baseline = (*baselines)[name];
    if (auto motion = motion_of(baseline, baseline_label(name, baseline), name))
      motions.push_back(std::move(*motion));
  }
  return report::draw_profile(
      fmt::format("{}: {:.2f} m, {:.2f} rad turned, {:.2f} s", answer.value("robot_id", std::string("robot")),
                  number_at(answer, "distance_m"), number_at(answer, "turned_rad"),
                  number_at(answer, "duration_s")),
      motions);
}

}  // namespace joulecast::client
