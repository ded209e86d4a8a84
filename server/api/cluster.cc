#include <algorithm>
#include <map>
#include <string>

#include "base/json_writer.h"
#include "server/api/services.h"

// The cluster that this daemon is a member of, as it last read it from the database.
namespace joulecast::api {
namespace {

using http::Method;
using http::Request;
using http::Response;

void write_member(JsonWriter& out, const history::Member& member, std::size_t robots, std::size_t heard) {
  out.begin_object()
      .field("node", member.node)
      .field("address", member.address)
      .field("version", member.version)
      .field("alive", member.expires_in_s > 0 && member.connected)
      .field("joined_s", member.joined_s)
      .field("lease_left_s", member.expires_in_s)
      .field("robots_kept", static_cast<std::uint64_t>(robots))
      .field("robots_heard", static_cast<std::uint64_t>(heard))
      .end_object();
}

void write_lease(JsonWriter& out, const history::Lease& lease, bool is_held) {
  out.begin_object().field("robot_id", lease.robot_id).key("node");
  is_held ? out.value(lease.node) : out.null();
  out.field("epoch", lease.epoch).field("taken_s", lease.taken_s).field("takeovers", lease.takeovers);
  out.time("stored", lease.position ? std::optional(lease.position->utime_us) : std::nullopt);
  out.field("stored_sequence", lease.position ? std::optional(lease.position->sequence) : std::nullopt);
  out.end_object();
}

Result<Response> cluster(const Services& services, const Request&) {
  // A daemon outside a cluster returns the same object with a null name.
  const server::ClusterStatus now =
      services.cluster != nullptr ? services.cluster->status() : server::ClusterStatus{};
  const auto named = [](const std::string& text) {
    return text.empty() ? std::nullopt : std::optional(text);
  };
  std::map<std::string, std::size_t> kept, heard;
  for (const history::Lease& lease : now.state.leases) ++kept[lease.node];
  for (const history::Hearing& each : now.state.hearings) ++heard[each.node];
  JsonWriter out;
  out.begin_object().field("name", named(now.name)).field("node", named(now.node));
  out.field("read_s", now.read_s).field("renewed_s", now.renewed_s).key("error");
  now.error.empty() ? out.null() : out.value(now.error);
  out.key("nodes").begin_array();
  for (const history::Member& member : now.state.members)
    write_member(out, member, kept[member.node], heard[member.node]);
  out.end_array().key("leases").begin_array();
  for (const history::Lease& lease : now.state.leases) {
    const auto holder = std::ranges::find(now.state.members, lease.node, &history::Member::node);
    write_lease(out, lease, holder != now.state.members.end());
  }
  out.end_array().key("own").begin_object();
  out.field("robots_kept", static_cast<std::uint64_t>(now.kept))
      .field("takeovers", now.takeovers)
      .field("handovers", now.handovers)
      .field("missions_resumed", now.resumed_missions)
      .field("commands_dropped", now.dropped_commands)
      .field("memberships_lost", now.memberships_lost)
      .field("held_messages", static_cast<std::uint64_t>(now.held_messages))
      .field("held_messages_dropped", now.held_dropped);
  out.end_object().end_object();
  return http::json_response(out.take());
}

}  // namespace

std::vector<TableRow> cluster_rows() {
  std::vector<TableRow> rows;
  rows.push_back({{.method = Method::get,
                   .path = "/v1/cluster",
                   .operation_id = "getCluster",
                   .role = http::Role::read,
                   .summary = "The daemons that share the fleet, and which of them keeps which robot; name "
                              "is null where cluster.name is not set",
                   .response_schema = "cluster"},
                  answered_by(cluster)});
  return rows;
}

}  // namespace joulecast::api
