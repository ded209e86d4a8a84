#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "gap/groups/comparer.h"
#include "gap/runs/run_referee.h"
#include "gap/runs/run_search.h"

namespace joulecast::gap {

Result<Comparison> compare_runs(const RunSet& set, std::span<const std::string> group_of_run,
                                const robot::RobotModel& robot, const CompareSettings& settings) {
  if (const auto adopted = dynamics::active_effects(robot); !adopted) return tl::unexpected(adopted.error());
  const std::set<std::string> names(group_of_run.begin(), group_of_run.end());
  if (names.size() < 2) return invalid("--compare-by", "gives one group only; two are needed to compare");
  Comparison c;
  for (const std::string& name : names) c.groups.push_back({name, 0, 0, 0, 0, 0});
  const auto index = [&](std::size_t run) {
    return static_cast<std::size_t>(std::distance(names.begin(), names.find(group_of_run[run])));
  };
  // The label that makes the groups is no cause beside them.
  RunSet compared = set;
  for (std::size_t l = compared.labels.size(); l-- > 0;) {
    for (std::size_t k = 0; k < compared.runs.size(); ++k) {
      if (compared.runs[k].labels[l] != group_of_run[k]) break;
      if (k + 1 < compared.runs.size()) continue;
      for (MissionRun& run : compared.runs) run.labels[l].clear();
    }
  }
  RunColumns columns(compared, robot);
  const std::vector<std::size_t> block = blocks_of(compared.runs, group_of_run);
  // What all runs share is found first; differences are judged around it.
  const RunFinding shared = search_runs(columns, block);
  columns.linearise_around(shared.causes);
  const RunReferee referee(columns);

  std::vector<std::size_t> group;
  for (std::size_t k = 0; k < block.size(); ++k) group.push_back(index(k));
  GroupedData data{
      robot, {}, std::vector<std::size_t>(1 + *std::ranges::max_element(block)), {}, {}, {}, {}, {}, {}, {}};
  data.without = [&](const std::vector<bool>& out) {
    std::vector<bool> runs_out(out.empty() ? 0 : block.size());
    for (std::size_t k = 0; k < runs_out.size(); ++k) runs_out[k] = out[block[k]];
    return make_problem(columns, learn_scatter(columns, runs_out, group), block);
  };
  const RunScatter scatter = learn_scatter(columns, {}, group);
  data.base = make_problem(columns, scatter, block);
  data.explain.most_families = 1;
  data.explain.most_members = 2;
  data.shared = shared.causes;
  double measured_j = 0, modelled_j = 0;
  for (std::size_t k = 0; k < block.size(); ++k) {
    data.group_of_block[block[k]] = index(k);
    const auto modelled = columns.modelled(k, shared.causes);
    const double measured = compared.runs[k].measured_j();
    data.items.push_back({index(k), block[k], measured, modelled.sum_j, 1 / measured, 1,
                          compared.runs[k].at.distance_m, modelled.duration_s});
    ComparedGroup& g = c.groups[index(k)];
    ++g.missions, ++g.samples;
    g.way_m += compared.runs[k].at.distance_m;
    g.energy_per_m_j += measured;
    g.model_per_m_j += modelled.sum_j;
    measured_j += measured;
    modelled_j += modelled.sum_j;
  }
  for (ComparedGroup& g : c.groups) g.energy_per_m_j /= g.way_m, g.model_per_m_j /= g.way_m;
  data.cause = [&](std::size_t h, const Eigen::VectorXd& coefficients) {
    return columns.causes_of({h}, coefficients).front();
  };
  data.predict = [&](const std::vector<std::vector<Cause>>& by_group) {
    std::vector<double> energies;
    for (std::size_t k = 0; k < block.size(); ++k) {
      std::vector<Cause> causes = shared.causes;
      causes.insert(causes.end(), by_group[index(k)].begin(), by_group[index(k)].end());
      energies.push_back(columns.modelled(k, causes).sum_j);
    }
    return energies;
  };
  data.referee = [&](const std::vector<double>& missed, const std::vector<bool>& use) {
    std::vector<double> answer(missed.size(), 0);
    for (std::size_t g = 0; g < c.groups.size(); ++g) {
      std::vector<bool> out(missed.size());
      for (std::size_t k = 0; k < out.size(); ++k) out[k] = !use[k] || index(k) != g;
      const std::vector<double> own = referee.fit(missed, out).energy_j;
      for (std::size_t k = 0; k < out.size(); ++k) {
        if (index(k) == g) answer[k] = own[k];
      }
    }
    return answer;
  };
  Diagnosis& d = c.diagnosis;
  d.robot_id = robot.robot_id;
  d.missions = d.samples = block.size();
  d.motor_channels = columns.by_motor();
  d.power = columns.by_motor() ? PowerSource::motors : PowerSource::battery;
  d.energy_relative = (measured_j - modelled_j) / measured_j;
  d.power_absolute_relative = columns.error(shared.causes);
  d.noise_floor = std::min(std::sqrt(2 / std::numbers::pi) * scatter.run, d.power_absolute_relative);
  d.channels = {
      {columns.by_motor() ? "motor_power" : "battery_power", d.power_absolute_relative, d.noise_floor}};
  for (const std::size_t h : shared.named) c.common.push_back(columns.hypotheses()[h].id());
  c.limits.emplace_back(
      "A group is what its name says and whatever else was different: day, payload, tyres, batteries, "
      "weather.");
  if (!compare_groups(data, settings, c)) return fail(Fault::conflict, "", "comparison cancelled");
  return c;
}

}  // namespace joulecast::gap
