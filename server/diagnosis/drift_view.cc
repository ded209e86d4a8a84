#include "server/diagnosis/drift_view.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/json_number.h"
#include "base/try.h"
#include "energy/drive_equations.h"
#include "robot/robot_fields.h"

namespace joulecast::server {
namespace {

// A tenth: a mission whose motion shows less would only add scatter.
constexpr double most_deviation = 0.1;

// Of a mission's findings. NaN: its motion does not show the parameter.
double found_over_model(const nlohmann::json& findings, energy::Unknown unknown) {
  const nlohmann::json::json_pointer at(
      "/parameters/" + std::string(energy::refined_names[static_cast<std::size_t>(unknown)]));
  if (!findings.is_object() || !findings.contains(at)) return signals::unmeasured;
  const nlohmann::json& found = findings[at];
  const double in_force = number_at(found, "in_force");
  if (!(number_at(found, "sd") < most_deviation * in_force)) return signals::unmeasured;
  return number_at(found, "value") / in_force;
}

constexpr std::size_t newest = 10;  // missions that represent the robot's present state

}  // namespace

Result<std::vector<drift::MissionRatio>> DriftView::missions(const std::string& robot_id,
                                                             std::size_t limit) const {
  history::MissionFilter filter;
  filter.robot_ids = {robot_id};
  history::PageRequest page;
  page.limit = history::max_page_size;
  std::vector<drift::MissionRatio> ratios;
  do {
    TRY_ASSIGN(history::MissionPage found, store_.missions(filter, page));
    for (const history::Mission& m : found.missions) {
      const signals::Accounts& a = m.accounts;
      // Only fully measured missions are compared: unmeasured time is in neither energy.
      if (m.state == history::MissionState::open || !(a.measured_s > 0.9 * a.duration_s) ||
          !(a.measured_j > 0) || !history::findings_of(m).teaches())
        continue;
      const double modelled_j = a.measured_j - a.ledger[signals::Term::unexplained];
      if (!(modelled_j > 0)) continue;
      const auto findings = nlohmann::json::parse(m.findings_json, nullptr, false);
      ratios.push_back({m.key, m.start_utime_us, m.model_version.value_or(0), a.measured_j, modelled_j,
                        found_over_model(findings, energy::Unknown::mass),
                        found_over_model(findings, energy::Unknown::battery_resistance)});
      if (ratios.size() == limit) break;
    }
    page.cursor = std::move(found.next_cursor);
  } while (!page.cursor.empty() && ratios.size() < limit);
  std::ranges::reverse(ratios);
  return ratios;
}

Result<std::vector<drift::Mark>> DriftView::marks(const std::string& robot_id) const {
  return missions(robot_id, options_.max_missions).map([&](const auto& found) {
    return drift::find_marks(found, options_.settings);
  });
}

Result<std::optional<std::int64_t>> DriftView::last_change(const std::string& robot_id,
                                                           std::int64_t version) const {
  return marks(robot_id).map([&](const auto& found) -> std::optional<std::int64_t> {
    if (found.empty() || found.back().model_version != version) return std::nullopt;
    return found.back().utime_us;
  });
}

Result<std::vector<drift::MissionRatio>> DriftView::recent(const ingest::ModelInForce& model) const {
  // Some of the newest may be of a version before.
  return missions(model.robot.robot_id, 4 * newest).map([&](auto found) {
    std::erase_if(found, [&](const auto& m) { return m.model_version != model.version; });
    if (found.size() > newest) found.erase(found.begin(), found.end() - newest);
    return found;
  });
}

Result<std::vector<drift::SiblingRatio>> DriftView::siblings(const std::string& robot_id) const {
  std::vector<drift::RobotRatios> kind;
  const auto model = models_.find(robot_id);
  if (model == nullptr) return compare(kind);
  for (const auto& other : models_.all()) {
    if (robot::kind_of(other->robot) != robot::kind_of(model->robot)) continue;
    TRY_ASSIGN(auto newest, recent(*other));
    kind.push_back({other->robot.robot_id, std::move(newest)});
  }
  return compare(kind);
}

}  // namespace joulecast::server
