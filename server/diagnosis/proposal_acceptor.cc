#include "server/diagnosis/proposal_acceptor.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "base/fault_boundary.h"
#include "robot/robot_file.h"

namespace joulecast::server {
namespace {

constexpr std::int64_t proposals_a_look = 100;  // newest first; older ones are left to a person

}  // namespace

ProposalAcceptor::ProposalAcceptor(const history::Store& store, ModelAdoption& adoption,
                                   std::function<void(const std::string&, const std::string&)> warn,
                                   std::function<bool(const std::string&)> is_own)
    : store_(store), adoption_(adoption), warn_(std::move(warn)), is_own_(std::move(is_own)) {}

ProposalAcceptor::~ProposalAcceptor() {
  stop();
}

int ProposalAcceptor::look() {
  auto found = store_.proposals(std::nullopt, std::numeric_limits<std::int64_t>::max(), proposals_a_look);
  if (!found) {
    warn_("", "proposals cannot be read: " + describe(found.error()));
    return 0;
  }
  int adopted = 0;
  std::int64_t newest = seen_id_;
  for (const history::Proposal& listed : *found) {
    if (listed.id <= seen_id_) break;
    newest = std::max(newest, listed.id);
    if (listed.state != history::ProposalState::open || listed.kind != "calibration") continue;
    if (is_own_ && !is_own_(listed.robot_id)) continue;
    // Lists leave the model out.
    if (const auto whole = store_.proposal(listed.id); whole && try_one(*whole)) ++adopted;
  }
  seen_id_ = newest;
  return adopted;
}

bool ProposalAcceptor::try_one(const history::Proposal& proposal) {
  auto model = robot::parse_robot(proposal.model_json);
  if (!model) {
    warn_(proposal.robot_id, "a proposal holds no valid robot file: " + describe(model.error()));
    return false;
  }
  AdoptionRequest request;
  request.model = std::move(*model);
  request.origin = history::ModelOrigin::calibration;
  request.note = proposal.note;
  request.fitted_on = proposal.fitted_on;
  request.proposal_id = proposal.id;
  request.expected_version = proposal.base_version;
  const auto adoption = adoption_.adopt(request);
  if (!adoption) {
    warn_(proposal.robot_id, "a proposal was not tested: " + describe(adoption.error()));
    return false;
  }
  if (!adoption->adopted) warn_(proposal.robot_id, "a proposal was not adopted: " + adoption->refusal);
  return adoption->adopted;
}

void ProposalAcceptor::start(std::chrono::milliseconds period) {
  running_ = true;
  thread_ = std::thread([this, period] {
    std::unique_lock lock(mutex_);
    while (running_) {
      lock.unlock();
      survive("proposal acceptor", [this] { look(); });
      lock.lock();
      wake_.wait_for(lock, period, [this] { return !running_; });
    }
  });
}

void ProposalAcceptor::stop() {
  {
    const std::lock_guard lock(mutex_);
    running_ = false;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

}  // namespace joulecast::server
