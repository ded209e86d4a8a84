#include "tests/study/cases_command.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "client/files.h"
#include "tests/study/outcome_lines.h"
#include "tests/study/trial/kept/kept_run.h"
#include "tests/study/trial/kept/kept_score.h"

namespace joulecast::client {
namespace {

namespace kept = trial::kept;

// The file is written after each case, so that a command that is stopped can be continued.
Exit record_cases(const CasesOptions& options, kept::KeptRun run, std::vector<kept::KeptCase> cases) {
  std::vector<kept::KeptCase> open;
  for (const kept::KeptCase& one : options.sample > 0 ? kept::sample_of(cases, options.sample) : cases) {
    if (one.digest.empty() || !one.truth) open.push_back(one);
  }
  std::size_t finished = 0;
  Result<void> written;
  const auto write = [&] {
    std::string text;
    for (const kept::KeptCase& one : cases) text += kept::case_line(one).dump() + "\n";
    written = write_text_file(options.record, text, Existing::replace);
  };
  run.draw_only = true;
  run.done = [&](const kept::KeptCase& made, const nlohmann::json&) {
    std::fprintf(stderr, "[%zu/%zu] %s %s\n", ++finished, open.size(), made.id.c_str(), made.digest.c_str());
    *std::ranges::find(cases, made.id, &kept::KeptCase::id) = made;
    write();
  };
  write();
  if (auto done = kept::run_kept(run, open); !done) return report(done.error());
  return written ? Exit::ok : report(written.error());
}

void print_scores(const CasesOptions& options, const std::vector<kept::KeptCase>& cases,
                  const std::vector<std::pair<std::string, kept::Answers>>& columns) {
  if (!options.json) {
    std::printf("%s", kept::score_table(cases, columns).c_str());
    return;
  }
  nlohmann::json out = nlohmann::json::array();
  for (const auto& [name, answers] : columns) {
    nlohmann::json scores = nlohmann::json::object();
    for (const auto& [group, score] : kept::score_kept(cases, answers))
      scores[group] = kept::kept_score_json(score);
    out.push_back({{"answers", name}, {"scores", scores}});
  }
  std::printf("%s\n", out.dump(2).c_str());
}

}  // namespace

Exit run_cases_of(const CasesOptions& options) {
  auto cases = kept::read_cases(options.cases);
  if (!cases) return report(cases.error());
  kept::KeptRun run;
  run.engine = {options.engine};
  run.recordings = options.recordings;
  run.keep = options.keep;
  run.jobs = options.jobs;
  if (!options.record.empty()) return record_cases(options, run, std::move(*cases));
  if (options.sample > 0) cases = kept::sample_of(*cases, options.sample);

  auto answers = kept::read_answers(options.answers, *cases);
  if (!answers) return report(answers.error());
  if (!options.kept_only) {
    std::vector<kept::KeptCase> open;
    std::ranges::copy_if(*cases, std::back_inserter(open),
                         [&](const kept::KeptCase& one) { return !answers->contains(one.id); });
    auto lines = OutcomeLines::open(options.answers);
    if (!lines) return report(lines.error());
    std::size_t finished = cases->size() - open.size();
    run.done = [&](const kept::KeptCase& one, const nlohmann::json& line) {
      std::fprintf(stderr, "[%zu/%zu] %s %s\n", ++finished, cases->size(), one.id.c_str(),
                   line.dump().c_str());
      lines->add(line);
      if (auto answer = kept::parse_answer(line.dump())) (*answers)[one.id] = std::move(*answer);
    };
    if (auto done = kept::run_kept(run, open); !done) return report(done.error());
    if (auto done = lines->close(); !done) return report(done.error());
    // Truths of cases that were kept without one.
    for (kept::KeptCase& one : *cases) {
      const auto at = std::ranges::find(open, one.id, &kept::KeptCase::id);
      if (at != open.end()) one.truth = at->truth;
    }
  }
  std::vector<std::pair<std::string, kept::Answers>> columns;
  const auto name_of_file = [](const std::string& path) {
    return std::filesystem::path(path).stem().string();
  };
  columns.emplace_back(options.answers.empty() ? "answers" : name_of_file(options.answers),
                       std::move(*answers));
  if (!options.against.empty()) {
    auto others = kept::read_answers(options.against, *cases);
    if (!others) return report(others.error());
    columns.emplace_back(name_of_file(options.against), std::move(*others));
  }
  print_scores(options, *cases, columns);
  return Exit::ok;
}

}  // namespace joulecast::client
