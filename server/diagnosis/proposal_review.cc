#include "server/diagnosis/proposal_review.h"

#include <nlohmann/json.hpp>

#include "base/fault_boundary.h"
#include "base/json_number.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "robot/robot_file.h"

namespace joulecast::server {
namespace {

using Json = nlohmann::json;

constexpr std::size_t criteria = 3;  // of BackTest::improves
constexpr std::int64_t newest_diagnoses = 20;

// The n-th test of a robot's model has 1/(n (n + 1)) of the chance of all.
std::size_t comparisons_of(const Json& detail) {
  const auto n = detail.value("tests", std::size_t{1});
  return criteria * n * (n + 1);
}

Result<AdoptionRequest> test_of(const history::Proposal& proposal, const Json& detail) {
  AdoptionRequest request;
  TRY_ASSIGN(request.model, robot::parse_robot(proposal.model_json));
  request.origin = history::ModelOrigin::calibration;
  request.note = proposal.note;
  request.fitted_on = proposal.fitted_on;
  request.expected_version = proposal.base_version;
  request.comparisons = comparisons_of(detail);
  request.dry_run = true;
  return request;
}

Json detail_of(const history::Proposal& proposal) {
  Json detail = Json::parse(proposal.detail_json, nullptr, false);
  return detail.is_object() ? detail : Json::object();
}

}  // namespace

void ProposalReview::suggest(history::Proposal candidate) {
  {
    const std::lock_guard lock(mutex_);
    std::string robot_id = candidate.robot_id;
    suggested_.insert_or_assign(std::move(robot_id), std::move(candidate));
  }
  wake_.notify_all();
}

void ProposalReview::mission_ended(const std::string& robot_id) {
  {
    const std::lock_guard lock(mutex_);
    ended_.insert(robot_id);
  }
  wake_.notify_all();
}

int ProposalReview::look() {
  std::map<std::string, history::Proposal> suggested;
  std::set<std::string> ended;
  {
    const std::lock_guard lock(mutex_);
    suggested.swap(suggested_);
    ended.swap(ended_);
  }
  if (const Result<void> stored = parts_.writer.flush(); !stored) options_.warn("", describe(stored.error()));
  const auto warn_of = [this](const std::string& robot_id, const Error& error) {
    options_.warn(robot_id, "a proposal was not reviewed: " + describe(error));
  };
  for (const std::string& robot_id : ended)
    if (const Result<void> done = review_open(robot_id); !done) warn_of(robot_id, done.error());
  int made = 0;
  for (auto& [robot_id, candidate] : suggested) {
    const Result<bool> reviewed = review(std::move(candidate));
    if (!reviewed) warn_of(robot_id, reviewed.error());
    made += reviewed.value_or(false);
  }
  return made;
}

Result<std::optional<history::Proposal>> ProposalReview::open_of(const std::string& robot_id) const {
  TRY_ASSIGN(const auto listed, parts_.store.proposals(robot_id, history::whole_future, 1));
  if (listed.empty() || listed.front().state != history::ProposalState::open) return std::nullopt;
  return parts_.store.proposal(listed.front().id).map([](auto found) {
    return std::optional(std::move(found));
  });
}

Result<std::optional<history::DiagnosisRecord>> ProposalReview::remedy(
    const std::string& robot_id, std::optional<std::int64_t> version) const {
  TRY_ASSIGN(const auto listed, parts_.store.diagnoses(robot_id, history::whole_future, newest_diagnoses));
  for (const history::DiagnosisRecord& d : listed) {
    if (d.state != history::DiagnosisState::done || d.model_version != version) continue;
    TRY_ASSIGN(history::DiagnosisRecord diagnosis, parts_.store.diagnosis(d.id));
    const Result<DiagnosedModel> model = diagnosed_model(parts_.store, diagnosis, {});
    if (!model) return std::nullopt;
    diagnosis.model_json = robot::to_json_text(model->model);
    return diagnosis;
  }
  return std::nullopt;
}

Result<bool> ProposalReview::review(history::Proposal candidate) {
  TRY_ASSIGN(const auto open, open_of(candidate.robot_id));
  if (open && open->base_version == candidate.base_version) return false;
  Json detail = detail_of(candidate);
  TRY_ASSIGN(AdoptionRequest request, test_of(candidate, detail));
  TRY_ASSIGN(const Adoption tested, adoption_.adopt(request));
  if (!tested.refusal.empty()) return false;
  TRY_ASSIGN(const auto diagnosis, remedy(candidate.robot_id, candidate.base_version));
  if (diagnosis) {
    TRY_ASSIGN(request.against, robot::parse_robot(diagnosis->model_json));
    TRY_ASSIGN(const Adoption compared, adoption_.adopt(request));
    if (!compared.refusal.empty()) return false;
    request.against.reset();
  }
  detail["back_test"] = Json::parse(tested.back_test_json);
  candidate.detail_json = detail.dump();
  TRY_ASSIGN(const std::int64_t id, parts_.writer.execute(history::AddProposal{std::move(candidate)}));
  if (!options_.automatic) return true;
  request.dry_run = false;
  request.proposal_id = id;
  return adoption_.adopt(request).map([](const Adoption&) { return true; });
}

Result<void> ProposalReview::review_open(const std::string& robot_id) {
  TRY_ASSIGN(const auto open, open_of(robot_id));
  if (!open) return {};
  const Json detail = detail_of(*open);
  TRY_ASSIGN(const auto marks, parts_.drift.marks(robot_id));
  if (!marks.empty() && marks.back().utime_us > detail.value("fitted_until_utime_us", std::int64_t{0}))
    return dismiss(*open, "the robot changed on " + utc_text(marks.back().utime_us).substr(0, 10) +
                              ", after the missions that it was fitted on");
  TRY_ASSIGN(AdoptionRequest request, test_of(*open, detail));
  const Result<Adoption> tested = adoption_.adopt(request);
  if (!tested && tested.error().fault == Fault::conflict) return {};  // another version is in force
  if (!tested) return tl::unexpected(tested.error());
  if (!tested->refusal.empty()) return dismiss(*open, "it no longer improves the model: " + tested->refusal);
  TRY_ASSIGN(const auto diagnosis, remedy(robot_id, open->base_version));
  if (!diagnosis) return {};
  request.against = std::move(request.model);
  TRY_ASSIGN(request.model, robot::parse_robot(diagnosis->model_json));
  request.fitted_on.insert(request.fitted_on.end(), diagnosis->fitted_on.begin(), diagnosis->fitted_on.end());
  TRY_ASSIGN(const Adoption compared, adoption_.adopt(request));
  if (!compared.refusal.empty()) return {};
  return dismiss(*open, "diagnosis " + std::to_string(diagnosis->id) + " predicts better");
}

Result<void> ProposalReview::dismiss(const history::Proposal& proposal, const std::string& reason) {
  TRY(parts_.writer.execute(history::CloseProposal{proposal.id, history::ProposalState::dismissed, {}}));
  const Json detail{{"proposal_id", proposal.id}, {"reason", reason}};
  return parts_.writer.offer(history::AppendEvent{
      {0, parts_.now_utime_us(), proposal.robot_id, "proposal_dismissed", json_text(detail)}});
}

void ProposalReview::start() {
  thread_ = std::jthread([this](const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
      wake_.wait(lock, stop, [this] { return !suggested_.empty() || !ended_.empty(); });
      lock.unlock();
      survive("proposal review", [this] { look(); });
      lock.lock();
    }
  });
}

}  // namespace joulecast::server
