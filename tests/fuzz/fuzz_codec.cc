#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "fuzz.h"
#include "signals/sample.h"
#include "telemetry/codec.h"
#include "telemetry/covariate_tracker.h"
#include "telemetry/validation.h"

namespace t = joulecast::telemetry;

namespace {

// Accepted messages must be exactly the output of the encoder.
void require_same(const joulecast::Result<std::vector<std::uint8_t>>& encoded,
                  std::span<const std::uint8_t> bytes) {
  if (!encoded || !std::equal(encoded->begin(), encoded->end(), bytes.begin(), bytes.end())) std::abort();
}

// A fuzzer cannot guess a 64-bit fingerprint: prepend the right one to its bytes.
template <class Decode, class Encode>
void try_type(const std::vector<std::uint8_t>& example, std::span<const std::uint8_t> data, Decode decode,
              Encode encode) {
  std::vector<std::uint8_t> bytes(example.begin(), example.begin() + 8);
  bytes.insert(bytes.end(), data.begin(), data.end());
  if (const auto decoded = decode(bytes)) require_same(encode(*decoded), bytes);
  (void)decode(data);
}

}  // namespace

JOULECAST_FUZZ_TARGET(codec) {
  static const auto telemetry = t::encode_telemetry("r", {}).value();
  static const auto mission =
      t::encode_mission_event("r", {0, "m", joulecast::signals::MissionPhase::started, 0, ""}).value();
  static const auto covariates = t::encode_covariates("r", {0, {{"a", 0}}}).value();
  static const auto signed_message = t::encode_signed({}).value();
  static const auto state = [] {
    joulecast::signals::EnergyState s;
    s.robot_id = "r";
    return t::encode_energy_state(s).value();
  }();
  const std::span input(data, size);
  try_type(
      telemetry, input, [](auto bytes) { return t::decode_telemetry(bytes); },
      [](const t::DecodedTelemetry& d) {
        if (const auto fault = t::check_plausible(d.sample)) (void)t::describe(*fault);
        return t::encode_telemetry(d.robot_id, d.sample);
      });
  try_type(
      mission, input, [](auto bytes) { return t::decode_mission_event(bytes); },
      [](const t::DecodedMissionEvent& d) { return t::encode_mission_event(d.robot_id, d.event); });
  try_type(
      covariates, input, [](auto bytes) { return t::decode_covariates(bytes); },
      [](const t::DecodedCovariates& d) {
        t::CovariateTracker tracker;
        std::vector<joulecast::signals::CovariateChange> changes(1);
        for (const joulecast::signals::Covariate& one : d.message.covariates) {
          if (t::check_plausible(one)) continue;
          if (tracker.take(d.message.utime_us, one, changes.back()) == t::CovariateTracker::Verdict::news)
            changes.emplace_back();
        }
        changes.pop_back();
        if (joulecast::signals::changes_of(joulecast::signals::series_of(changes)).size() != changes.size())
          std::abort();
        return t::encode_covariates(d.robot_id, d.message);
      });
  try_type(
      signed_message, input, [](const auto& bytes) { return t::decode_signed(bytes); },
      [](const t::SignedMessage& d) {
        if (t::is_authentic("ROBOT_TELEMETRY.r", d, "a key that signed nothing of this")) std::abort();
        return t::encode_signed(d);
      });
  try_type(
      state, input, [](auto bytes) { return t::decode_energy_state(bytes); },
      [](const joulecast::signals::EnergyState& d) { return t::encode_energy_state(d); });
}
