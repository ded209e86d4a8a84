#include "server/webhooks/webhook_file.h"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "access/secret_file.h"
#include "base/json_fields.h"
#include "base/text_file.h"

namespace joulecast::server {
namespace {

using Json = nlohmann::json;

constexpr std::size_t longest_text = 2048;
constexpr std::size_t shortest_secret = 16;

std::string all_kinds() {
  std::string text;
  for (const std::string& kind : event_kinds()) text += (text.empty() ? "" : ", ") + kind;
  return text;
}

void read_events(Fields& fields, std::set<std::string>& events) {
  const Json* list = fields.member("events");
  if (list == nullptr) {
    events = event_kinds();
    return;
  }
  if (!list->is_array() || list->empty()) return fields.fault("events", "must be an array of kinds");
  for (const Json& kind : *list) {
    if (!kind.is_string() || !event_kinds().contains(kind.get<std::string>()))
      return fields.fault("events", "has " + kind.dump() + "; the kinds are " + all_kinds());
    events.insert(kind.get<std::string>());
  }
}

Result<Webhook> read_webhook(const Json& value, const std::string& at, const std::filesystem::path& folder) {
  Fields fields(value, at);
  Webhook webhook;
  const std::string url = fields.text("url", longest_text);
  const std::string secret_file = fields.text("secret_file", longest_text);
  read_events(fields, webhook.events);
  if (Result<void> done = fields.finish(); !done) return tl::unexpected(std::move(done.error()));
  auto address = http_client::parse_url(url, at + "/url");
  if (!address) return tl::unexpected(std::move(address.error()));
  webhook.host = address->host + ':' + address->port;
  webhook.address = std::move(*address);
  auto secret = access::read_secret((folder / secret_file).string(), shortest_secret);
  if (!secret) return invalid(at + "/secret_file", describe(secret.error()));
  webhook.secret = std::move(*secret);
  return webhook;
}

Result<std::vector<Webhook>> parse(std::string_view text, const std::filesystem::path& folder) {
  const auto list = read_list(text, "webhooks");
  if (!list) return tl::unexpected(list.error());
  std::vector<Webhook> webhooks;
  for (std::size_t k = 0; k < list->size(); ++k) {
    Result<Webhook> webhook = read_webhook((*list)[k], "/webhooks/" + std::to_string(k), folder);
    if (!webhook) return tl::unexpected(std::move(webhook.error()));
    webhooks.push_back(std::move(*webhook));
  }
  return webhooks;
}

}  // namespace

Result<std::vector<Webhook>> read_webhooks(const std::string& path) {
  const Result<std::string> text = read_text_file(path);
  if (!text) return tl::unexpected(text.error());
  Result<std::vector<Webhook>> webhooks = parse(*text, std::filesystem::path(path).parent_path());
  if (!webhooks) return invalid(path, describe(webhooks.error()));
  return webhooks;
}

const std::set<std::string>& event_kinds() {
  static const std::set<std::string> kinds{
      "charge_low",          "charge_restored", "charged",       "contradiction",
      "contradiction_ended", "gap_diagnosed",   "gap_drift",     "gap_sibling",
      "host_clock_step",     "internal_fault",  "mission",       "mission_annulled",
      "mission_id_reused",   "model_activated", "model_adopted", "proposal_dismissed",
      "robot_back",          "robot_removed",   "robot_silent",  "undeclared_payload"};
  return kinds;
}

}  // namespace joulecast::server
