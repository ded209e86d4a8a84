#include "server/diagnosis/proposal_review.h"

#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/fault_boundary.h"
#include "base/try.h"
#include "robot/robot_file.h"

namespace joulecast::server {
namespace {

constexpr std::int64_t proposals_a_look = 100;  // newest first

Result<void> without_id(const history::Outcome& outcome) {
  if (!outcome) return tl::unexpected(outcome.error());
  return {};
}

}  // namespace

bool is_offered(const history::Proposal& proposal) {
  if (proposal.state != history::ProposalState::open) return false;
  if (proposal.kind != "calibration") return true;
  const auto detail = nlohmann::json::parse(proposal.detail_json, nullptr, false);
  return detail.is_object() && detail.contains("back_test");
}

ProposalReview::ProposalReview(const history::Store& store, history::Writer& writer, ModelAdoption& adoption,
                               std::function<std::int64_t()> now_utime_us, ReviewOptions options)
    : store_(store),
      writer_(writer),
      adoption_(adoption),
      now_utime_us_(std::move(now_utime_us)),
      options_(std::move(options)) {}

ProposalReview::~ProposalReview() {
  stop();
}

int ProposalReview::look() {
  const auto found =
      store_.proposals(std::nullopt, std::numeric_limits<std::int64_t>::max(), proposals_a_look);
  if (!found) {
    options_.warn("", "proposals cannot be read: " + describe(found.error()));
    return 0;
  }
  int passed = 0;
  for (const history::Proposal& listed : *found) {
    if (listed.state != history::ProposalState::open || is_offered(listed)) continue;
    if (options_.is_own && !options_.is_own(listed.robot_id)) continue;
    // Lists leave the model out.
    const auto whole = store_.proposal(listed.id);
    const Result<bool> reviewed = whole ? review(*whole) : tl::unexpected(whole.error());
    if (!reviewed)
      options_.warn(listed.robot_id, "a proposal was not reviewed: " + describe(reviewed.error()));
    passed += reviewed.value_or(false);
  }
  return passed;
}

Result<bool> ProposalReview::review(const history::Proposal& proposal) {
  Result<robot::RobotModel> model = robot::parse_robot(proposal.model_json);
  if (!model) return dismiss(proposal, describe(model.error())).map([] { return false; });
  AdoptionRequest request;
  request.model = std::move(*model);
  request.origin = history::ModelOrigin::calibration;
  request.note = proposal.note;
  request.fitted_on = proposal.fitted_on;
  request.expected_version = proposal.base_version;
  request.dry_run = true;
  const Result<Adoption> tested = adoption_.adopt(request);
  // Another test may be running, or the store unreachable: tried again at the next look.
  if (!tested && tested.error().fault == Fault::unavailable) return false;
  if (!tested) return dismiss(proposal, describe(tested.error())).map([] { return false; });
  if (!tested->refusal.empty()) return dismiss(proposal, tested->refusal).map([] { return false; });
  return offer(proposal, *tested, std::move(request)).map([] { return true; });
}

Result<void> ProposalReview::dismiss(const history::Proposal& proposal, const std::string& reason) {
  TRY(without_id(
      writer_.execute(history::CloseProposal{proposal.id, history::ProposalState::dismissed, {}})));
  const nlohmann::json detail{{"proposal_id", proposal.id}, {"reason", reason}};
  return writer_.offer(
      history::AppendEvent{{0, now_utime_us_(), proposal.robot_id, "proposal_dismissed",
                            detail.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)}});
}

Result<void> ProposalReview::offer(history::Proposal proposal, const Adoption& tested,
                                   AdoptionRequest request) {
  auto detail = nlohmann::json::parse(proposal.detail_json, nullptr, false);
  if (!detail.is_object()) detail = nlohmann::json::object();
  detail["back_test"] = nlohmann::json::parse(tested.back_test_json);
  proposal.detail_json = detail.dump();
  const history::Outcome id = writer_.execute(history::AddProposal{std::move(proposal)});
  if (!id || !options_.automatic) return without_id(id);
  request.dry_run = false;
  request.proposal_id = *id;
  const Result<Adoption> adopted = adoption_.adopt(request);
  if (!adopted) return tl::unexpected(adopted.error());
  return {};
}

void ProposalReview::start(std::chrono::milliseconds period) {
  running_ = true;
  thread_ = std::thread([this, period] {
    std::unique_lock lock(mutex_);
    while (running_) {
      lock.unlock();
      survive("proposal review", [this] { look(); });
      lock.lock();
      wake_.wait_for(lock, period, [this] { return !running_; });
    }
  });
}

void ProposalReview::stop() {
  {
    const std::lock_guard lock(mutex_);
    running_ = false;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

}  // namespace joulecast::server
