#include "tests/study/trial/motion/motion_case.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "base/text_file.h"
#include "client/files.h"
#include "robot/robot_file.h"
#include "telemetry/event_log.h"
#include "tests/study/trial/motion/made_recording.h"

namespace joulecast::trial::motion {
namespace {

using nlohmann::json;
using virtual_robot::Rng;

constexpr double own_form_share = 0.4;  // where there is one: about a third of all
constexpr double downward_share = 0.25;
constexpr double most_alike = 0.9;  // effects of a pair

std::vector<std::string_view> catalogue_ids() {
  std::vector<std::string_view> ids;
  for (const Form& form : forms()) {
    if (ids.empty() || ids.back() != form.id) ids.push_back(form.id);
  }
  return ids;
}

std::optional<OutsideLoad> outside_of(std::string_view id) {
  for (std::size_t k = 0; k < outside_load_count; ++k) {
    if (name_of(static_cast<OutsideLoad>(k)) == id) return static_cast<OutsideLoad>(k);
  }
  return std::nullopt;
}

Kind kind_at(const MotionSettings& settings, std::size_t index) {
  if (!settings.only_effect.empty()) return outside_of(settings.only_effect) ? Kind::outside : Kind::single;
  return settings.only.value_or(kind_in_turn(index));
}

// Effects that this recording cannot have, or has under another name.
bool fits(const BaseLog& base, std::string_view id) {
  if (id == "aerodynamic_drag") return base.fit.form.fast;
  return id != "chassis_mass_error" || base.fit.form.turns;  // straight on, it is inertia alone
}

const Form& form_of(Rng& rng, std::string_view id) {
  std::vector<const Form*> known, own;
  for (const Form& form : forms()) {
    if (form.id == id) (form.catalogue ? known : own).push_back(&form);
  }
  const bool differs = rng.chance(own_form_share) && !own.empty();
  const auto& from = differs ? own : known;
  return *from[rng.index(from.size())];
}

// The other effect with the usual form that adds the most similar power.
std::pair<std::string, double> nearest_of(const MotionCase& c, const Planted& planted,
                                          std::span<const Instant> instants) {
  std::pair<std::string, double> nearest;
  for (const Form& form : forms()) {
    if (!form.catalogue || form.id == planted.form->id || !fits(*c.base, form.id)) continue;
    const double alike = std::fabs(likeness(c.scene, planted, {&form, 1e-3, 0}, instants));
    if (alike > nearest.second) nearest = {std::string(form.id), alike};
  }
  return nearest;
}

void plant_effects(const MotionSettings& settings, std::size_t turn, Rng& rng, MotionCase& c) {
  constexpr std::size_t tries = 60;
  const std::size_t wanted = c.truth.kind == Kind::pair ? 2 : 1;
  const auto ids = catalogue_ids();
  const std::vector<Instant> instants = c.base->log.all_instants();
  for (std::size_t k = 0; k < tries && c.planted.size() < wanted; ++k) {
    // Effects that this recording cannot have make way for others.
    const std::size_t number = turn * wanted + c.planted.size() + 7 * (k - c.planted.size());
    const std::string_view id = settings.only_effect.empty()
                                    ? ids[in_turn(settings.seed, wanted, ids.size(), number)]
                                    : settings.only_effect;
    const Form& form = form_of(rng, id);
    const bool downward = rng.chance(downward_share) && form.least != nullptr;
    if (!fits(*c.base, id)) continue;
    auto planted = planted_at(c.scene, form, c.truth.gap_class, downward, instants);
    if (!planted && downward) planted = planted_at(c.scene, form, c.truth.gap_class, false, instants);
    if (!planted) continue;
    if (!c.planted.empty() && (c.planted[0].form->id == id ||
                               std::fabs(likeness(c.scene, c.planted[0], *planted, instants)) > most_alike)) {
      continue;
    }
    c.planted.push_back(*planted);
    const auto [nearest, alike] = nearest_of(c, *planted, instants);
    c.truth.effects.push_back({std::string(id), std::string(form.form), form.catalogue, planted->strength,
                               planted->gap, nearest, alike});
  }
  if (c.planted.size() < wanted) c.truth.kind = c.planted.empty() ? Kind::none : Kind::single;
  if (c.planted.empty()) c.truth.gap_class = 0;
}

void plant_outside(const MotionSettings& settings, std::size_t turn, Rng& rng, MotionCase& c) {
  const std::vector<Instant> instants = c.base->log.all_instants();
  for (std::size_t k = 0; k < 4 * outside_load_count && c.outside_w.empty(); ++k) {
    const OutsideLoad load =
        outside_of(settings.only_effect)
            .value_or(static_cast<OutsideLoad>(in_turn(settings.seed, 3, outside_load_count, turn + k)));
    c.outside_w = outside_load_w(load, instants, rng);
    if (c.outside_w.empty()) continue;
    const double size_w = c.truth.gap_class * c.scene.base_power_w;
    for (double& power_w : c.outside_w) power_w *= size_w;
    c.truth.effects.push_back(
        {std::string(name_of(load)), "load of its own", false, size_w, c.truth.gap_class, "", 0});
  }
  if (c.outside_w.empty()) {
    c.truth.kind = Kind::none;
    c.truth.gap_class = 0;
  }
}

std::vector<std::vector<MeteredPower>> made_power(const MotionCase& c) {
  auto noise_w = c.base->fit.residual_w;
  if (c.noise_seed) {
    Rng rng(*c.noise_seed);
    noise_w = resampled(c.base->fit.residual_w, c.base->log.battery.period_s, rng);
  }
  std::vector<std::vector<MeteredPower>> made;
  std::size_t n = 0;
  for (std::size_t m = 0; m < noise_w.size(); ++m) {
    auto& of_mission = made.emplace_back();
    for (std::size_t k = 0; k < noise_w[m].size(); ++k, ++n) {
      MeteredPower power = planted_power(c.scene, c.planted, c.base->log.instants[m][k]);
      const double more_w = noise_w[m][k] + (c.outside_w.empty() ? 0 : c.outside_w[n]);
      of_mission.push_back({power.drawn_w + more_w, power.read_w + more_w});
    }
  }
  return made;
}

std::string truth_text(const MotionCase& c) {
  json effects = json::array();
  for (const TrueEffect& e : c.truth.effects) {
    effects.push_back({{"id", e.id},
                       {"form", e.form},
                       {"catalogue", e.catalogue},
                       {"strength", e.strength},
                       {"gap", e.gap},
                       {"nearest", e.nearest},
                       {"likeness", e.likeness}});
  }
  const json truth{{"case", c.index},
                   {"kind", name_of(c.truth.kind)},
                   {"motion", c.truth.log},
                   {"gap_class", c.truth.gap_class},
                   {"effects", effects}};
  return truth.dump(2) + "\n";
}

Result<void> write_log(const MotionCase& c, const std::filesystem::path& path) {
  auto log = telemetry::EventLogWriter::create(path.string());
  if (!log) return tl::unexpected(std::move(log.error()));
  for (const telemetry::Recording& mission : made_recording(c.base->log, made_power(c))) {
    if (auto done = telemetry::write_recording(*log, mission); !done) return done;
  }
  return log->close();
}

}  // namespace

Result<std::vector<BaseLog>> read_base_logs(const std::filesystem::path& folder,
                                            std::vector<std::string>& skipped) {
  std::vector<std::filesystem::path> paths;
  std::error_code failed;
  for (const auto& entry : std::filesystem::directory_iterator(folder, failed)) {
    if (entry.path().extension() == ".lcmlog") paths.push_back(entry.path());
  }
  if (failed)
    return fail(Fault::not_found, "--motion", folder.string() + " cannot be read: " + failed.message());
  std::ranges::sort(paths);
  std::vector<BaseLog> logs;
  for (const auto& path : paths) {
    auto log = read_motion_log(path);
    if (!log) {
      skipped.push_back(describe(log.error()));
      continue;
    }
    BaseLog base{std::move(*log), {}, {}};
    base.fit = fit_log(base.log);
    base.file = base_robot(base.log, base.fit.form, base.fit.base);
    if (auto valid = robot::validate(base.file); !valid) {
      skipped.push_back(path.filename().string() +
                        ": its base power is no robot file's: " + describe(valid.error()));
      continue;
    }
    const std::vector<Instant> instants = base.log.all_instants();
    base.mismatch = base_mismatch(base.file, base.fit.form, base.fit.base, instants);
    double left_w = 0, base_w = 0;
    for (const auto& of_mission : base.fit.residual_w) {
      for (const double r : of_mission) left_w += std::fabs(r);
    }
    for (const Instant& at : instants) base_w += std::fabs(base_power_w(base.fit.form, base.fit.base, at));
    base.residual = base_w > 0 ? left_w / base_w : 0;
    logs.push_back(std::move(base));
  }
  if (logs.empty()) {
    std::string why = folder.string() + " holds no log that can serve";
    for (const std::string& sentence : skipped) why += "; " + sentence;
    return fail(Fault::infeasible, "--motion", why);
  }
  return logs;
}

std::vector<std::string_view> motion_effect_ids() {
  auto ids = catalogue_ids();
  for (std::size_t k = 0; k < outside_load_count; ++k) ids.push_back(name_of(static_cast<OutsideLoad>(k)));
  return ids;
}

MotionCase draw_motion_case(const MotionSettings& settings, std::span<const BaseLog> logs,
                            std::size_t index) {
  Rng rng = Rng::stream(settings.seed, 400'000'000 + index);
  MotionCase c;
  c.index = index;
  c.noise_seed = rng.next();  // drawn either way: the cases are the same
  if (settings.residuals_in_place) c.noise_seed.reset();
  c.base = &logs[in_turn(settings.seed, 4, logs.size(), index)];
  c.truth.log = c.base->log.name;
  c.truth.kind = kind_at(settings, index);
  c.scene = scene_of(c.base->log, c.base->fit, rng);
  const std::size_t turn = settings.only || !settings.only_effect.empty() ? index : turn_in_kind(index);
  if (c.truth.kind == Kind::outside) {
    c.truth.gap_class = gap_classes[1 + turn % (gap_classes.size() - 1)];
    plant_outside(settings, turn, rng, c);
  } else if (c.truth.kind != Kind::none) {
    c.truth.gap_class = gap_classes[turn % gap_classes.size()];
    plant_effects(settings, turn, rng, c);
  }
  return c;
}

Result<std::uint64_t> write_motion_case(const MotionCase& c, const CaseFiles& files) {
  std::error_code failed;
  std::filesystem::create_directories(files.folder, failed);
  if (failed) return fail(Fault::unavailable, files.folder.string(), "cannot be made: " + failed.message());
  if (auto done = write_text_file(files.robot().string(), robot::to_json_text(c.base->file) + "\n",
                                  Existing::replace);
      !done)
    return tl::unexpected(std::move(done.error()));
  if (auto done = write_log(c, files.log()); !done) return tl::unexpected(std::move(done.error()));
  if (auto done = write_text_file(files.truth().string(), truth_text(c), Existing::replace); !done)
    return tl::unexpected(std::move(done.error()));
  return digest_of(files);
}

Result<MotionTruth> open_motion_truth(const std::filesystem::path& path) {
  const Result<std::string> text = read_text_file(path);
  if (!text) return tl::unexpected(text.error());
  const json document = json::parse(*text, nullptr, false);
  try {
    MotionTruth truth;
    const auto kind = kind_of(document.at("kind").get<std::string>());
    if (!kind) return fail(Fault::corrupt, path.string() + "#/kind", "is no kind of case");
    truth.kind = *kind;
    truth.log = document.at("motion").get<std::string>();
    truth.gap_class = document.at("gap_class").get<double>();
    for (const json& e : document.at("effects")) {
      truth.effects.push_back({e.at("id").get<std::string>(), e.at("form").get<std::string>(),
                               e.at("catalogue").get<bool>(), e.at("strength").get<double>(),
                               e.at("gap").get<double>(), e.at("nearest").get<std::string>(),
                               e.at("likeness").get<double>()});
    }
    return truth;
  } catch (const json::exception& e) {
    return fail(Fault::corrupt, path.string(), e.what());
  }
}

}  // namespace joulecast::trial::motion
