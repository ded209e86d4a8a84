#include "tests/study/trial/kept/kept_run.h"

#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <sstream>
#include <utility>

#include "base/text_file.h"
#include "tests/study/trial/case_files.h"
#include "tests/study/trial/case_pool.h"
#include "tests/study/trial/foreign/foreign_case.h"
#include "tests/study/trial/motion/motion_case.h"

namespace joulecast::trial::kept {
namespace {

using nlohmann::json;

// A case's files with their digest and, of generated ones, the truth.
struct Made {
  CaseFiles files;
  std::uint64_t digest = 0;
  std::optional<KeptTruth> truth;
};

Result<Made> made_by_motion(const KeptCase& kept, std::span<const motion::BaseLog> logs,
                            const CaseFiles& files) {
  motion::MotionSettings settings;
  settings.seed = kept.seed;
  const motion::MotionCase drawn = motion::draw_motion_case(settings, logs, kept.index);
  const auto digest = motion::write_motion_case(drawn, files);
  if (!digest) return tl::unexpected(digest.error());
  KeptTruth truth;
  truth.kind = drawn.truth.kind;
  for (const motion::TrueEffect& e : drawn.truth.effects) {
    truth.effects.push_back({e.id, e.catalogue ? std::optional(e.strength) : std::nullopt});
    truth.gap += e.gap;
  }
  return Made{files, *digest, truth};
}

Result<Made> made_by_robot(const KeptCase& kept, const CaseFiles& files) {
  TrialSettings settings;
  settings.seed = kept.seed;
  settings.channels = kept.channels == "battery" ? ChannelChoice::battery : ChannelChoice::full;
  const auto digest = drive_case(draw_case(settings, kept.index), files);
  if (!digest) return tl::unexpected(digest.error());
  const auto sealed = open_truth(files.truth());
  if (!sealed) return tl::unexpected(sealed.error());
  KeptTruth truth;
  truth.kind = sealed->kind;
  truth.gap = sealed->added_gap;
  for (const auto& effect : sealed->effects)
    truth.effects.push_back({effect.id, effect.parameters.front().second});
  return Made{files, *digest, truth};
}

Result<Made> made_by_foreign(const KeptCase& kept, const CaseFiles& files) {
  const foreign::ForeignCase drawn = foreign::draw_foreign_case(kept.seed, kept.index);
  const auto digest = foreign::write_foreign_case(drawn, kept.channels != "battery", files);
  if (!digest) return tl::unexpected(digest.error());
  KeptTruth truth;
  truth.kind = drawn.kind;
  truth.gap = drawn.gap;
  for (const auto& [id, strength] : drawn.effects) truth.effects.push_back({id, strength});
  return Made{files, *digest, truth};
}

Result<Made> make(const KeptRun& run, const KeptCase& kept, std::span<const motion::BaseLog> logs,
                  const CaseFiles& files) {
  if (kept.group == "recorded_motion") return made_by_motion(kept, logs, files);
  if (kept.group == "virtual_robots") return made_by_robot(kept, files);
  if (kept.group == "foreign_plant") return made_by_foreign(kept, files);
  if (kept.recording.empty())
    return fail(Fault::invalid, kept.id, "\"" + kept.group + "\" is not a generated group");
  const CaseFiles recorded{run.recordings / kept.recording};
  const auto digest = digest_of_files({recorded.robot(), recorded.log()});
  if (!digest) return tl::unexpected(digest.error());
  return Made{recorded, *digest, kept.truth};
}

struct Finished {
  std::size_t index = 0;
  std::string digest;
  std::optional<KeptTruth> truth;
  json line;
};

}  // namespace

Result<Answers> read_answers(const std::filesystem::path& path, const std::vector<KeptCase>& cases) {
  Answers answers;
  if (path.empty() || !std::filesystem::exists(path)) return answers;
  std::map<std::string, std::string> digests;
  for (const KeptCase& kept : cases) digests[kept.id] = kept.digest;
  const auto text = read_text_file(path);
  if (!text) return tl::unexpected(text.error());
  std::istringstream lines(*text);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty()) continue;
    auto answer = parse_answer(line);
    if (!answer) return fail(Fault::corrupt, path.string(), describe(answer.error()));
    const json document = json::parse(line);
    const auto id = document.value("case", ""), digest = document.value("digest", "");
    const auto known = digests.find(id);
    if (known != digests.end() && !known->second.empty() && known->second != digest) {
      return fail(Fault::conflict, path.string(),
                  id + " is answered for files of another digest than the case's");
    }
    answers[id] = std::move(*answer);
  }
  return answers;
}

Result<void> run_kept(const KeptRun& run, std::vector<KeptCase>& cases) {
  std::vector<motion::BaseLog> logs;
  if (std::ranges::any_of(cases, [](const KeptCase& c) { return c.group == "recorded_motion"; })) {
    std::vector<std::string> skipped;
    auto read = motion::read_base_logs(run.recordings / "motion", skipped);
    if (!read) return tl::unexpected(std::move(read.error()));
    logs = std::move(*read);
  }
  const auto run_case = [&](std::size_t index, const CaseFiles& files) -> Result<Finished> {
    const KeptCase& kept = cases[index];
    auto made = make(run, kept, logs, files);
    if (!made) return tl::unexpected(std::move(made.error()));
    Finished finished{index, fmt::format("{:016x}", made->digest), std::move(made->truth), {}};
    if (!kept.digest.empty() && kept.digest != finished.digest) {
      return fail(Fault::conflict, kept.id,
                  "its files have the digest " + finished.digest + ", not " + kept.digest);
    }
    if (run.draw_only) return finished;
    auto line = ask(run.engine, made->files.log(), made->files.robot());
    if (!line) return tl::unexpected(std::move(line.error()));
    finished.line = std::move(*line);
    finished.line["case"] = kept.id;
    finished.line["digest"] = finished.digest;
    return finished;
  };
  const auto done =
      run_cases<Finished>(cases.size(), run.jobs, run.keep, run_case, [&](const Finished& finished) {
        KeptCase& kept = cases[finished.index];
        kept.digest = finished.digest;
        kept.truth = finished.truth;
        if (run.done) run.done(kept, finished.line);
      });
  if (!done) return tl::unexpected(done.error());
  return {};
}

}  // namespace joulecast::trial::kept
