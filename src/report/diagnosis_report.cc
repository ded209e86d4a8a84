#include <fmt/format.h>

#include <cmath>

#include "base/xml_text.h"
#include "gap/verdict/words.h"
#include "report/quantity.h"
#include "report/report.h"
#include "report/sections.h"

namespace joulecast::report {

using namespace gap;

namespace {

std::string gap_text(const Diagnosis& d) {
  if (!std::isfinite(d.power_absolute_relative))
    return "no power was recorded that the model could be held against";
  return fmt::format("measured {} and the model's differ by {} of the power",
                     d.power == PowerSource::motors ? "motor power" : "battery power",
                     share_text(d.power_absolute_relative));
}

std::string names_of(std::span<const DiagnosedEffect> effects) {
  std::vector<std::string> names;
  for (const DiagnosedEffect& e : effects) {
    std::string name = words_of(e.id);
    if (!e.alternatives.empty()) {
      std::vector<std::string> others;
      for (const std::string& id : e.alternatives) others.push_back(words_of(id));
      name += " (or " + enumerate(others) + ", which these data do not distinguish from it)";
    }
    names.push_back(std::move(name));
  }
  return enumerate(names);
}

std::string verdict_text(const Diagnosis& d) {
  const std::string names = names_of(d.effects);
  switch (d.verdict) {
    case Verdict::effects: {
      const bool one = d.effects.size() == 1;
      if (!std::isfinite(d.power_absolute_relative))
        return capital(names) + (one ? " is" : " are") + " found.";
      return capital(names) + (one ? " explains it" : " explain it") +
             (d.shrinkage ? fmt::format(": on parts left out the gap falls from {} to {}.",
                                        share_text(d.shrinkage->before), share_text(d.shrinkage->after))
                          : ".");
    }
    case Verdict::none:
      return fmt::format(
          "No effect is missing that these data could show; one that moves {} of the power would be seen.",
          share_text(d.detectable_share));
    case Verdict::outside:
      return "Part of it comes from something outside the catalogue of effects.";
    case Verdict::not_this_robot:
      return "The robot file is not this robot's, or not as it ran here.";
    case Verdict::inconclusive:
      break;
  }
  return "These data do not decide what causes it" + (names.empty() ? "." : "; likeliest: " + names + ".");
}

std::vector<Page::Figure> tiles_of(const Diagnosis& d) {
  std::vector<Page::Figure> tiles{
      {share_text(d.power_absolute_relative), "of the power is missed by the model as it is"}};
  if (d.shrinkage && !d.effects.empty())
    tiles.push_back({share_text(d.shrinkage->after), "is missed with the effects, on parts left out"});
  tiles.push_back({share_text(d.noise_floor),
                   "is the noise floor: the error that an unstructured model of the data cannot remove"});
  tiles.push_back({share_text(d.energy_relative), "of the energy is missed; positive: the robot takes more"});
  tiles.push_back({chance_text(d.verdict_probability),
                   "probability of the verdict \"" + words_of(name_of(d.verdict)) + "\""});
  return tiles;
}

std::vector<std::string> limits_of(const Diagnosis& d) {
  std::vector<std::string> limits;
  if (!d.motor_channels) {
    limits.emplace_back(
        "The motors' currents were not recorded. The judgement rests on battery power and motion, so that "
        "effects in the motors, the drivers and friction are harder to distinguish.");
  }
  if (d.power == PowerSource::motors)
    limits.emplace_back(
        "The battery was not recorded; power is that of the motors with the file's idle power.");
  if (d.power == PowerSource::none)
    limits.emplace_back("No power was recorded; effects are estimated from other readings.");
  if (d.detectable_share > 0) {
    limits.push_back(
        fmt::format("An effect that moves less than about {} of the power could not be seen in these data.",
                    share_text(d.detectable_share)));
  }
  limits.emplace_back(
      "Effects are named from a catalogue; several small ones can look like one of it. Strengths hold for "
      "the conditions driven.");
  return limits;
}

void method_section(Page& page) {
  page.section("Method");
  const std::vector<std::string> method{
      "Signs, units, scales and channels are checked first; contradicted channels are excluded.",
      "Recordings are averaged under smooth windows; slopes are taken under the windows' slopes, so that no "
      "noisy signal is differentiated.",
      "Each equation between measured channels is compared with the drive model; each effect of the "
      "catalogue has its own trace in them. How much an equation counts, by its update rate, colour and "
      "tails, is learnt from the data.",
      "Sets of effects are compared by their evidence, averaged over resampled blocks of the recordings; "
      "smooth functions represent effects outside the catalogue, and a strength that drifts along the "
      "run is no effect.",
      "Parts of the recordings are left out in turn and predicted without them: by the robot file, by the "
      "effects found and by a plain regression."};
  page.list(method);
}

}  // namespace

void next_drive_section(Page& page, std::span<const NextDrive> drives) {
  if (drives.empty()) return;
  page.section("What to drive next", "Manoeuvres that would distinguish what these data cannot.");
  std::vector<std::vector<std::string>> rows;
  for (const NextDrive& n : drives)
    rows.push_back(
        {xml_escaped(n.manoeuvre), xml_escaped(words_of(n.separates)), brief(n.expected_log_evidence, 2)});
  const std::vector<std::string> header{"Drive", "to distinguish", "log evidence it adds"};
  page.table(header, rows, 2);
}

void origin_section(Page& page, const ReportOrigin& origin, const robot::RobotModel& robot) {
  page.section("Origin of the data");
  std::vector<std::string> lines;
  if (!origin.sources.empty()) lines.push_back("Read from: " + enumerate(origin.sources) + ".");
  std::string model = "Model: robot " + robot.robot_id;
  if (!origin.model.empty()) model += ", " + origin.model;
  std::vector<std::string> adopted;
  for (const robot::AdoptedEffect& e : robot.effects) adopted.push_back(words_of(e.id));
  lines.push_back(model + (adopted.empty() ? "; no effect was adopted before."
                                           : "; effects adopted before: " + enumerate(adopted) + "."));
  lines.push_back(
      fmt::format("Mass {} kg without payload, wheel radius {} m, half track {} m, friction torque {} and {} "
                  "N m (right, left), idle power {} W.",
                  brief(robot.total_mass_kg(0)), brief(robot.kinematics.wheel_radius_m),
                  brief(robot.kinematics.half_track_m), brief(robot.motor.friction_torque_nm[0]),
                  brief(robot.motor.friction_torque_nm[1]), brief(robot.idle_power_w)));
  if (!origin.made_at.empty() || !origin.software.empty()) {
    lines.push_back("Report made" + (origin.made_at.empty() ? "" : " " + origin.made_at + " UTC") +
                    (origin.software.empty() ? "" : " by " + origin.software) + ".");
  }
  page.list(lines);
}

std::string report_html(const Diagnosis& d, const robot::RobotModel& robot, const ReportOrigin& origin) {
  Page page("Why the power of robot " + d.robot_id + " differs from its model",
            "Diagnosis of recorded missions",
            fmt::format("On {} {}. {}", count_text(d.missions, "mission"), gap_text(d), verdict_text(d)));
  page.figures(tiles_of(d));
  checks_section(page, d.checks);
  if (!d.reasons.empty()) {
    page.section("Reasons for the verdict");
    page.list(d.reasons);
  }
  effects_section(page, d.effects, d.figures.mean_power_w);
  outside_card(page, d.outside);
  adoption_section(page, d);
  held_out_section(page, d);
  channels_section(page, d.channels);
  where_section(page, d);
  floor_section(page, d);
  power_section(page, d);
  next_drive_section(page, d.next_drive);
  page.section("Limits");
  page.list(limits_of(d));
  method_section(page);
  missions_section(page, d);
  origin_section(page, origin, robot);
  return page.str();
}

}  // namespace joulecast::report
