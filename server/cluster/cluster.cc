#include "server/cluster/cluster.h"

#include <algorithm>
#include <utility>

#include "base/fault_boundary.h"
#include "base/host_clock.h"
#include "base/text.h"
#include "base/try.h"
#include "robot/robot_file.h"

namespace joulecast::server {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr milliseconds turn_period{250};
constexpr milliseconds exchange_period{250};
// A connection may be cut and made again; a killed daemon makes none.
constexpr milliseconds gone_patience{1000};
constexpr std::int64_t heard_us = 5'000'000;       // a robot counts as received for this long after a message
constexpr std::int64_t own_heard_us = 10'000'000;  // the same of one that is kept, so that others cease first
constexpr milliseconds settling_patience{2000};
constexpr milliseconds job_period{2000};
constexpr std::chrono::minutes longest_release{2};  // a writer that takes no data for so long has lost it
constexpr std::uint64_t turns_between_learning = 4;

double seconds_since(const std::optional<Clock::time_point>& then) {
  if (!then) return std::numeric_limits<double>::quiet_NaN();
  return std::chrono::duration<double>(Clock::now() - *then).count();
}

// FNV-1a of both names, mixed by the finalizer of MurmurHash3: the same in every build and on every machine.
std::uint64_t weight(std::string_view node, std::string_view robot_id) {
  constexpr std::string_view end = "\xff";
  std::uint64_t hash = fnv1a(end, fnv1a(robot_id, fnv1a(end, fnv1a(node))));
  hash = (hash ^ hash >> 33) * 0xff51afd7ed558ccdULL;
  hash = (hash ^ hash >> 33) * 0xc4ceb9fe1a85ec53ULL;
  return hash ^ hash >> 33;
}

struct Hearers {
  std::vector<std::string> settled, longest;
  double longest_s = -1;

  void add(const history::Hearing& each) {
    if (each.since_s >= settled_s) settled.push_back(each.node);
    if (each.since_s > longest_s) longest.clear();
    if (each.since_s >= longest_s) longest.push_back(each.node), longest_s = each.since_s;
  }
};

}  // namespace

std::string keeper_of(std::string_view robot_id, const std::vector<std::string>& nodes) {
  const auto most = std::ranges::max_element(nodes, {}, [&](const std::string& node) {
    return std::pair(weight(node, robot_id), std::string_view(node));
  });
  return most == nodes.end() ? std::string() : *most;
}

Assignment assign(const history::ClusterState& state, const Asker& asker) {
  std::vector<std::string> alive;
  std::set<std::string, std::less<>> members;
  for (const history::Member& member : state.members) {
    members.insert(member.node);
    if (asker.is_alive(member)) alive.push_back(member.node);
  }
  std::map<std::string, Hearers, std::less<>> hearers;
  for (const history::Hearing& each : state.hearings)
    if (std::ranges::find(alive, each.node) != alive.end()) hearers[each.robot_id].add(each);
  std::map<std::string, history::Lease, std::less<>> leases;
  for (const history::Lease& lease : state.leases) leases.emplace(lease.robot_id, lease);
  for (const auto& [robot_id, of_robot] : hearers) {
    history::Lease none;
    none.robot_id = robot_id;
    leases.try_emplace(robot_id, std::move(none));
  }

  Assignment decided;
  for (const auto& [robot_id, lease] : leases) {
    const auto found = hearers.find(robot_id);
    const Hearers of_robot = found == hearers.end() ? Hearers{} : found->second;
    const bool own = lease.node == asker.node, left_over = own && !asker.keeps(lease);
    if (left_over || lease.node.empty() || !members.contains(lease.node)) {
      // An open mission must be ended even when its robot sends no more messages.
      const auto& candidates = !of_robot.settled.empty()   ? of_robot.settled
                               : !of_robot.longest.empty() ? of_robot.longest
                                                           : alive;
      if (keeper_of(robot_id, candidates) == asker.node)
        decided.take.push_back(lease);
      else if (left_over)
        decided.free.push_back(lease);
    } else if (own && lease.taken_s >= settled_s) {
      const std::string keeper = keeper_of(robot_id, of_robot.settled);
      if (!keeper.empty() && keeper != asker.node) decided.hand_over.push_back(lease);
    }
  }
  return decided;
}

// Data that the daemons of a cluster exchange through the database: the live state of the robots that each
// keeps, models that were put in force, and learned forecasts. After a turn, this daemon answers for the
// others' robots as of then, and keeps to the missions that they were requested to begin and end.
class Exchange {
 public:
  Exchange(std::string node, std::unique_ptr<history::SharedState> shared, const Cluster::Parts& parts)
      : node_(std::move(node)), shared_(std::move(shared)), parts_(parts) {}

  // Call several times a second; one thread.
  Result<void> turn() {
    TRY(publish());
    TRY(hear());
    TRY(follow_models());
    TRY(follow_requests());
    return turns_++ % turns_between_learning == 0 ? follow_learning() : Result<void>();
  }

 private:
  Result<void> publish() {
    std::vector<history::LiveState> news;
    std::map<std::string, std::shared_ptr<const ingest::RobotSnapshot>> now;
    for (const auto& [robot_id, epoch] : parts_.keeping.kept()) {
      auto snapshot = parts_.fleet.find(robot_id);
      if (snapshot == nullptr) continue;
      const auto published = published_.find(robot_id);
      if (published == published_.end() || published->second != snapshot)
        news.push_back({robot_id, node_, epoch, ingest::snapshot_bytes(*snapshot)});
      now.emplace(robot_id, std::move(snapshot));
    }
    Result<void> put = shared_->put(news);
    if (put) published_ = std::move(now);
    return put;
  }

  Result<void> hear() {
    TRY_ASSIGN(const auto news, shared_->news(node_));
    for (const history::LiveState& state : news) {
      if (parts_.keeping.epoch_of(state.robot_id) != 0) continue;
      auto snapshot = ingest::snapshot_from_bytes(state.body);
      // Not in an earlier or later version's layout; under its own name.
      if (snapshot == nullptr || snapshot->robot_id != state.robot_id) continue;
      if (const std::int64_t now = parts_.now_utime_us(); snapshot->received_utime_us > now) {
        auto received = std::make_shared<ingest::RobotSnapshot>(*snapshot);
        received->received_utime_us = now;  // the keeper's clock is ahead of this host's
        snapshot = std::move(received);
      }
      parts_.fleet.publish(std::move(snapshot));
    }
    return {};
  }

  Result<void> put_in_force(const std::string& robot_id, std::int64_t version) {
    TRY_ASSIGN(const auto stored, parts_.store.model(robot_id, version));
    TRY_ASSIGN(robot::RobotModel robot, robot::parse_robot(stored.model_json));
    return parts_.models.put(std::move(robot), version);
  }

  // A request to this daemon puts its model into the store and then in force. A model that was in force
  // before the store was read and differs from the stored one was therefore changed by another daemon.
  Result<void> follow_models() {
    const auto version_of = [this](const std::string& robot_id) {
      const auto model = parts_.models.find(robot_id);
      return model != nullptr ? std::optional(model->version) : std::nullopt;
    };
    std::map<std::string, std::optional<std::int64_t>> before;
    for (const auto& model : parts_.models.all()) before.emplace(model->robot.robot_id, model->version);
    TRY_ASSIGN(auto stored, shared_->active_models());
    for (const auto& [robot_id, version] : before) stored.try_emplace(robot_id);  // removed with all of it
    for (const auto& [robot_id, version] : stored) {
      const std::optional<std::int64_t> own = before[robot_id];
      if (own == version || version_of(robot_id) != own) continue;
      if (version) {
        TRY(put_in_force(robot_id, *version));
      } else {
        parts_.models.remove(robot_id);
        parts_.fleet.remove(robot_id);
      }
    }
    return {};
  }

  Result<void> follow_learning() {
    TRY_ASSIGN(auto read, shared_->learned(std::string(ingest::Forecasts::topic)));
    for (const auto& [robot_id, utime_us] : read) {
      const auto known = learned_.find(robot_id);
      if (known != learned_.end() && known->second != utime_us && parts_.keeping.epoch_of(robot_id) == 0)
        parts_.forecasts.learnt_elsewhere(robot_id);
    }
    learned_ = std::move(read);
    return {};
  }

  // A robot that is taken up later is given its requests by the pipeline, which ignores repeated ones.
  Result<void> follow_requests() {
    TRY_ASSIGN(const auto read, shared_->learned(std::string(ingest::mission_request_topic)));
    for (const auto& [robot_id, utime_us] : read) {
      std::int64_t& passed = requested_[robot_id];
      if (passed == utime_us || parts_.keeping.epoch_of(robot_id) == 0) continue;
      TRY_ASSIGN(const auto requests, ingest::stored_mission_requests(parts_.store, robot_id));
      for (const ingest::MissionRequest& request : requests) parts_.request_mission(robot_id, request);
      passed = utime_us;
    }
    return {};
  }

  const std::string node_;
  const std::unique_ptr<history::SharedState> shared_;
  const Cluster::Parts& parts_;
  std::map<std::string, std::shared_ptr<const ingest::RobotSnapshot>> published_;
  std::map<std::string, std::int64_t> learned_, requested_;
  std::uint64_t turns_ = 0;
};

Cluster::Cluster(ClusterOptions options, Parts parts)
    : options_(std::move(options)), parts_(std::move(parts)) {
  status_.name = options_.name;
  status_.node = options_.node;
}

Cluster::~Cluster() {
  leave();
}

Result<void> Cluster::start(const std::string& address) {
  leases_ = std::make_unique<history::Leases>(history::LeaseOptions{options_.url, options_.name,
                                                                    options_.node, address, JOULECAST_VERSION,
                                                                    options_.writer, options_.lifetime});
  // One that was killed a moment ago had this name.
  Result<void> joined = leases_->join();
  for (const auto until = Clock::now() + options_.lifetime + gone_patience;
       !joined && joined.error().fault == Fault::conflict && Clock::now() < until; joined = leases_->join())
    std::this_thread::sleep_for(turn_period);
  if (!joined) return joined;
  {
    const std::lock_guard lock(mutex_);
    renewed_ = steady_since_ = Clock::now();
  }
  keeper_ = std::jthread([this](const std::stop_token& stop) { keep(stop); });
  exchanger_ = std::jthread([this](const std::stop_token& stop) { exchange(stop); });
  return {};
}

void Cluster::settle_down() {
  std::unique_lock lock(mutex_);
  settling_ = true;
  if (keeper_.joinable()) settles_.wait_for(lock, settling_patience, [this] { return settled_; });
  settled_ = true;
}

void Cluster::leave() {
  if (!keeper_.joinable()) return;
  for (std::jthread* thread : {&keeper_, &exchanger_}) thread->request_stop();
  keeper_ = {};
  exchanger_ = {};
  if (const Result<void> left = leases_->leave(); !left)
    parts_.note("the cluster was not notified that this daemon leaves: " + describe(left.error()));
}

ClusterStatus Cluster::status() const {
  const std::lock_guard lock(mutex_);
  ClusterStatus now = status_;
  now.read_s = seconds_since(read_);
  now.renewed_s = seconds_since(renewed_);
  now.kept = parts_.keeping.kept().size();
  now.resumed_missions = parts_.keeping.resumed_missions;
  now.dropped_commands = parts_.store.fenced();
  now.held_messages = parts_.keeping.held_messages;
  now.held_bytes = parts_.keeping.held_bytes;
  now.held_dropped = parts_.keeping.held_dropped;
  return now;
}

bool Cluster::is_first() const {
  const std::lock_guard lock(mutex_);
  for (const history::Member& member : status_.state.members)
    if (member.expires_in_s > 0) return member.node == options_.node;
  return true;
}

void Cluster::on_dropped(const std::string& robot_id, history::Epoch epoch, std::uint64_t count) {
  parts_.keeping.withdraw({robot_id, epoch, false});
  const std::lock_guard lock(mutex_);
  if (reported_dropped_ && Clock::now() - *reported_dropped_ < std::chrono::minutes(1)) return;
  reported_dropped_ = Clock::now();
  parts_.note(std::to_string(count) + " commands for " + robot_id +
              " were dropped: another daemon keeps it since");
}

void Cluster::keep(const std::stop_token& stop) {
  for (bool again = true; again || sleep_for(stop, turn_period);) {
    again = false;
    survive("cluster leases", [&] {
      const Result<bool> turned = turn();
      note(turned ? Result<void>() : tl::unexpected(turned.error()));
      again = turned.value_or(false);
    });
  }
}

void Cluster::note(const Result<void>& done) {
  std::string text;
  {
    const std::lock_guard lock(mutex_);
    const std::string why = done ? std::string() : describe(done.error());
    if (!done) steady_since_.reset();
    if (why.empty() != status_.error.empty())
      text = done ? "the cluster's leases are renewed again" : "the cluster's leases are not renewed: " + why;
    status_.error = why;
  }
  if (!text.empty()) parts_.note(text);
}

// True when the next turn should follow immediately.
Result<bool> Cluster::turn() {
  TRY(renew());
  TRY(publish_heard());
  TRY_ASSIGN(auto state, leases_->state());
  ingest::Keeping::Leases leases;
  for (const history::Lease& lease : state.leases) leases.emplace(lease.robot_id, lease.position);
  parts_.keeping.note_leases(std::move(leases));
  {
    const std::lock_guard lock(mutex_);
    status_.state = state;
    read_ = Clock::now();
    if (!steady_since_) steady_since_ = read_;
    if (settled_) return false;
  }
  const Result<bool> buried = bury(state);
  if (!buried || *buried) return buried;
  TRY_ASSIGN(const std::size_t taken, reassign(state));
  {
    const std::lock_guard lock(mutex_);
    if (settling_) {
      settled_ = taken == 0 && gone_since_.empty();
      settles_.notify_all();
      return taken > 0;
    }
  }
  return take_jobs().map([] { return false; });
}

Result<void> Cluster::renew() {
  Result<void> renewed = leases_->renew();
  if (!renewed && renewed.error().fault == Fault::conflict) {
    // The membership expired. Messages received meanwhile may have gaps, so all earlier ones are discarded.
    parts_.keeping.withdraw_all();
    parts_.keeping.forget_heard();
    said_heard_.clear();
    {
      const std::lock_guard lock(mutex_);
      ++status_.memberships_lost;
      steady_since_.reset();
    }
    parts_.note(
        "this daemon did not renew its membership, and others keep its robots; it joins the cluster again");
    renewed = leases_->join();
  }
  if (renewed) {
    const std::lock_guard lock(mutex_);
    renewed_ = Clock::now();
  }
  return renewed;
}

Result<void> Cluster::publish_heard() {
  const std::int64_t now = parts_.now_utime_us();
  std::set<std::string> heard;
  for (const auto& [robot_id, utime_us] : parts_.keeping.heard()) {
    const bool kept = parts_.keeping.epoch_of(robot_id) != 0;
    if (now - utime_us < (kept ? own_heard_us : heard_us)) heard.insert(robot_id);
  }
  std::vector<std::string> more, no_longer;
  for (const std::string& robot_id : heard)
    if (!said_heard_.contains(robot_id)) more.push_back(robot_id);
  for (const std::string& robot_id : said_heard_)
    if (!heard.contains(robot_id)) no_longer.push_back(robot_id);
  if (more.empty() && no_longer.empty()) return {};
  Result<void> done = leases_->hear(more, no_longer);
  if (done) said_heard_ = std::move(heard);
  return done;
}

// Time of this daemon's uninterrupted access to the database.
Clock::duration Cluster::steadily() const {
  const std::lock_guard lock(mutex_);
  return steady_since_ ? Clock::now() - *steady_since_ : Clock::duration::zero();
}

bool Cluster::is_alive(const history::Member& member) const {
  if (member.node == options_.node) return true;
  return member.expires_in_s > 0 && !gone_since_.contains(member.incarnation);
}

// Ends the memberships of daemons that are gone. After the database was away all of them may look so until
// they have reached it again.
Result<bool> Cluster::bury(const history::ClusterState& state) {
  std::map<std::int64_t, Clock::time_point> gone;
  bool any = false;
  const auto steady = steadily();
  for (const history::Member& member : state.members) {
    if (member.node == options_.node) continue;
    if (!member.connected) {
      const auto since = gone_since_.find(member.incarnation);
      gone.emplace(member.incarnation, since != gone_since_.end() ? since->second : Clock::now());
    }
    const bool expired = member.expires_in_s <= 0 && steady > options_.lifetime;
    const bool cut_off = !member.connected && steady > gone_patience &&
                         Clock::now() - gone.at(member.incarnation) > gone_patience;
    if (!expired && !cut_off) continue;
    TRY_ASSIGN(const bool buried, leases_->bury(member));
    any |= buried;
    if (buried)
      parts_.note("daemon " + member.node + " of the cluster is gone: " +
                  (cut_off ? "its connection has ended" : "it does not renew its leases"));
  }
  gone_since_ = std::move(gone);
  return any;
}

// Answers how many robots this daemon took.
Result<std::size_t> Cluster::reassign(const history::ClusterState& state) {
  const Assignment assigned =
      assign(state, {options_.node, [this](const history::Member& member) { return is_alive(member); },
                     [this](const history::Lease& lease) { return keeps(lease); }});
  if (!assigned.take.empty()) {
    TRY_ASSIGN(const auto taken, leases_->take(assigned.take));
    for (const history::Lease& lease : taken) {
      parts_.forecasts.learnt_elsewhere(lease.robot_id);
      parts_.keeping.grant({lease.robot_id, lease.epoch, lease.position});
    }
    const std::lock_guard lock(mutex_);
    for (const history::Lease& lease : taken) {
      const auto before = std::ranges::find(assigned.take, lease.robot_id, &history::Lease::robot_id);
      if (before != assigned.take.end() && !before->node.empty()) ++status_.takeovers;
    }
  }
  for (const history::Lease& lease : assigned.hand_over) {
    const history::Epoch epoch = parts_.keeping.epoch_of(lease.robot_id);
    if (epoch != lease.epoch) continue;
    parts_.keeping.withdraw({lease.robot_id, epoch, true});
    letting_go_[lease.robot_id] = {epoch, Clock::now()};
    const std::lock_guard lock(mutex_);
    ++status_.handovers;
  }
  if (!assigned.free.empty()) TRY(leases_->free(assigned.free));
  return assigned.take.size();
}

bool Cluster::keeps(const history::Lease& lease) {
  if (parts_.keeping.epoch_of(lease.robot_id) == lease.epoch) return true;
  const auto found = letting_go_.find(lease.robot_id);
  return found != letting_go_.end() && found->second.epoch == lease.epoch &&
         Clock::now() - found->second.since < longest_release;
}

Result<void> Cluster::take_jobs() {
  if (Clock::now() - looked_for_jobs_ < job_period || steadily() < options_.lifetime) return {};
  looked_for_jobs_ = Clock::now();
  TRY_ASSIGN(const auto jobs, leases_->take_jobs());
  for (const std::int64_t id : jobs) parts_.take_job(id);
  return {};
}

void Cluster::exchange(const std::stop_token& stop) {
  Exchange exchange(options_.node,
                    std::make_unique<history::SharedState>(options_.url, options_.writer + "-exchange"),
                    parts_);
  bool reported = false;
  do {
    survive("cluster exchange", [&] {
      const Result<void> turned = exchange.turn();
      if (!turned && !reported)
        parts_.note("live states are not exchanged with the other daemons: " + describe(turned.error()));
      reported = !turned;
    });
  } while (sleep_for(stop, exchange_period));
}

}  // namespace joulecast::server
