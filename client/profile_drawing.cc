#include "client/profile_drawing.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "report/profile_drawing.h"

namespace joulecast::client {
namespace {

using nlohmann::json;

std::vector<double> column(const json& object, const char* name) {
  std::vector<double> values;
  const auto found = object.find(name);
  if (found == object.end() || !found->is_array()) return values;
  for (const json& value : *found) values.push_back(value.is_number() ? value.get<double>() : std::nan(""));
  return values;
}

std::optional<report::DrawnMotion> motion_of(const json& holder, std::string label, std::string_view style) {
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

double number(const json& object, const char* name) {
  const auto found = object.find(name);
  return found != object.end() && found->is_number() ? found->get<double>() : std::nan("");
}

std::string baseline_label(const char* name, const json& baseline) {
  return fmt::format("{}, as long on every run: {:.1f} J; the plan saves {:.1f} %{}", name,
                     number(baseline, "energy_j"), 100 * number(baseline, "saving_fraction"),
                     baseline.value("within_limits", true) ? "" : " (breaks the robot's limits)");
}

}  // namespace

Result<std::string> draw_answer(const json& answer) {
  const auto baselines = answer.find("baselines");
  const bool planned = baselines != answer.end() && baselines->is_object();
  auto own = motion_of(
      answer, fmt::format("{}: {:.1f} J", planned ? "least energy" : "motion", number(answer, "energy_j")),
      "plan");
  if (!own) return fail(Fault::corrupt, "profile", "the answer has no columns to draw");
  std::vector<report::DrawnMotion> motions{std::move(*own)};
  for (const char* name : {"trapezoid", "triangle"}) {
    if (!planned || !baselines->contains(name)) continue;
    const json& baseline = (*baselines)[name];
    if (auto motion = motion_of(baseline, baseline_label(name, baseline), name))
      motions.push_back(std::move(*motion));
  }
  return report::draw_profile(
      fmt::format("{}: {:.2f} m, {:.2f} rad turned, {:.2f} s", answer.value("robot_id", std::string("robot")),
                  number(answer, "distance_m"), number(answer, "turned_rad"), number(answer, "duration_s")),
      motions);
}

}  // namespace joulecast::client
