#include "server/gap_metrics.h"

#include <string>
#include <utility>
#include <vector>

namespace joulecast::server {

void export_gap_metrics(Metrics& metrics, const DiagnosisService& diagnoses, const GapWatch& watch,
                        const ModelAdoption& adoption) {
  const std::vector<Counter> ended =
      metrics.counters("joulecast_diagnoses_ended_total", "Diagnoses that ended since the start", "state",
                       std::vector<std::string>{"done", "failed", "cancelled"});
  using Jobs = DiagnosisCounts;
  metrics.rows<Jobs>([&diagnoses] { return diagnoses.counts(); },
                     {{"joulecast_diagnosis_seconds_total", "Time spent on diagnoses", &Jobs::seconds},
                      {"joulecast_diagnoses_waiting", "Waiting diagnoses", &Jobs::waiting},
                      {"joulecast_diagnosis_running", "1 while a diagnosis runs", &Jobs::running}});
  using Seen = WatchCounts;
  metrics.rows<Seen>(
      [&watch] { return watch.counts(); },
      {{"joulecast_gap_watch_rounds_total", "Examinations of all robots' missions", &Seen::rounds},
       {"joulecast_gap_drifts_total", "Drifts of the gap found", &Seen::drifts},
       {"joulecast_gap_drifting_robots", "Robots with a drift of the gap under their model in force",
        &Seen::drifting},
       {"joulecast_gap_outlying_robots", "Robots that differ significantly from the others of their kind",
        &Seen::standing_out},
       {"joulecast_gap_ratio_min", "Smallest of the robots' measured over modelled energy, newest missions",
        &Seen::ratio_min},
       {"joulecast_gap_ratio_median", "Median of the robots' measured over modelled energy",
        &Seen::ratio_median},
       {"joulecast_gap_ratio_max", "Greatest of the robots' measured over modelled energy",
        &Seen::ratio_max}});
  const std::vector<Counter> adoptions =
      metrics.counters("joulecast_models_tested_total", "Models that were back-tested to be adopted",
                       "outcome", std::vector<std::string>{"adopted", "forced", "refused"});
  metrics.before_scrape([=, &diagnoses, &adoption] {
    const DiagnosisCounts jobs = diagnoses.counts();
    ended[0].raise_to(static_cast<double>(jobs.done));
    ended[1].raise_to(static_cast<double>(jobs.failed));
    ended[2].raise_to(static_cast<double>(jobs.cancelled));
    const AdoptionCounts models = adoption.counts();
    adoptions[0].raise_to(static_cast<double>(models.adopted));
    adoptions[1].raise_to(static_cast<double>(models.forced));
    adoptions[2].raise_to(static_cast<double>(models.refused));
  });
}

void export_attention_metrics(Metrics& metrics, const api::AttentionList& list) {
  metrics.series([&list] {
    Metrics::Series all{"joulecast_attention",
                        "Robots, or the service, on the attention list and not acknowledged, by severity"};
    for (const std::string_view severity : api::severity_names)
      all.rows.emplace_back(Labels{{"severity", std::string(severity)}}, 0);
    for (const api::AttentionEntry& entry : list.entries())
      if (const api::AttentionReason& worst = entry.reasons.front(); !worst.acknowledged)
        ++all.rows[static_cast<std::size_t>(worst.severity)].second;
    return std::vector<Metrics::Series>{std::move(all)};
  });
}

}  // namespace joulecast::server
