#include "tests/study/trial/kept/kept_case.h"

#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "base/text_file.h"

namespace joulecast::trial::kept {
namespace {

using nlohmann::json;

std::optional<double> optional_number(const json& from, const char* key) {
  const auto at = from.find(key);
  return at != from.end() && at->is_number() ? std::optional(at->get<double>()) : std::nullopt;
}

std::vector<Expected> expected_at(const json& truth, const char* key) {
  std::vector<Expected> out;
  for (const json& e : truth.value(key, json::array())) {
    out.push_back({e.at("id").get<std::string>(), optional_number(e, "from"), optional_number(e, "to")});
  }
  return out;
}

KeptTruth truth_of(const json& from) {
  KeptTruth truth;
  if (from.contains("kind")) truth.kind = kind_of(from.at("kind").get<std::string>());
  for (const json& e : from.value("effects", json::array())) {
    truth.effects.push_back({e.at("id").get<std::string>(), optional_number(e, "strength")});
  }
  truth.gap = from.value("gap", 0.0);
  truth.right = expected_at(from, "right");
  truth.neutral = expected_at(from, "neutral");
  truth.outside = from.value("outside", "");
  truth.refuted = from.value("refuted", "");
  truth.corrections = from.value("corrections", "");
  truth.other = from.value("other", "");
  return truth;
}

json truth_json(const KeptTruth& truth) {
  json out = json::object();
  const auto add = [](json& to, const char* key, const std::optional<double>& value) {
    if (value) to[key] = *value;
  };
  if (truth.kind) {
    json effects = json::array();
    for (const PlantedEffect& e : truth.effects) {
      effects.push_back({{"id", e.id}});
      add(effects.back(), "strength", e.strength);
    }
    out = {{"kind", name_of(*truth.kind)}, {"effects", effects}, {"gap", truth.gap}};
  }
  for (const auto& [key, list] : {std::pair{"right", &truth.right}, std::pair{"neutral", &truth.neutral}}) {
    for (const Expected& e : *list) {
      json one{{"id", e.id}};
      add(one, "from", e.from);
      add(one, "to", e.to);
      out[key].push_back(std::move(one));
    }
  }
  for (const auto& [key, text] :
       {std::pair{"outside", &truth.outside}, std::pair{"refuted", &truth.refuted},
        std::pair{"corrections", &truth.corrections}, std::pair{"other", &truth.other}}) {
    if (!text->empty()) out[key] = *text;
  }
  return out;
}

void add_cases(const json& line, std::vector<KeptCase>& cases) {
  KeptCase one;
  one.group = line.at("group").get<std::string>();
  one.channels = line.at("channels").get<std::string>();
  one.recording = line.value("recording", "");
  one.seed = line.value("seed", std::uint64_t{0});
  one.digest = line.value("digest", "");
  if (line.contains("truth")) one.truth = truth_of(line.at("truth"));
  const std::size_t first = line.value("index", std::size_t{0}), count = line.value("count", std::size_t{1});
  for (one.index = first; one.index < first + count; ++one.index) {
    one.id = one.recording.empty() ? one.group + "/" + one.channels + "/" + std::to_string(one.seed) + "/" +
                                         std::to_string(one.index)
                                   : one.recording;
    cases.push_back(one);
  }
}

}  // namespace

Result<std::vector<KeptCase>> read_cases(const std::filesystem::path& path) {
  const auto text = read_text_file(path);
  if (!text) return tl::unexpected(text.error());
  std::vector<KeptCase> cases;
  std::istringstream lines(*text);
  std::size_t number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    if (line.empty()) continue;
    try {
      add_cases(json::parse(line), cases);
    } catch (const json::exception& e) {
      return fail(Fault::corrupt, path.string() + ":" + std::to_string(number), e.what());
    }
  }
  return cases;
}

json case_line(const KeptCase& kept) {
  json out{{"group", kept.group}, {"channels", kept.channels}};
  if (kept.recording.empty()) {
    out["seed"] = kept.seed;
    out["index"] = kept.index;
  } else {
    out["recording"] = kept.recording;
  }
  if (!kept.digest.empty()) out["digest"] = kept.digest;
  if (kept.truth) out["truth"] = truth_json(*kept.truth);
  return out;
}

std::vector<KeptCase> sample_of(const std::vector<KeptCase>& cases, std::size_t count) {
  std::map<std::pair<std::string, std::string>, std::size_t> taken;
  std::vector<KeptCase> sample;
  for (const KeptCase& one : cases) {
    if (taken[{one.group, one.channels}]++ < count) sample.push_back(one);
  }
  return sample;
}

}  // namespace joulecast::trial::kept
