#include "history/shared_state.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "history/postgres.h"
#include "history/sql_store.h"

namespace joulecast::history {
namespace {

class PostgresSharedState final : public SharedState {
 public:
  PostgresSharedState(std::string url, std::string name) : url_(std::move(url)), name_(std::move(name)) {}

  Result<void> put(const std::vector<LiveState>& states) override {
    return work([&](Database& database) -> Result<void> {
      if (states.empty()) return {};
      Transaction transaction(database, Database::Access::write);
      for (const LiveState& state : states) {
        Rows rows(database.statement(
            "INSERT INTO cluster_live AS old VALUES (?1, ?2, ?3, 1, ?4) ON CONFLICT (robot_id) DO UPDATE SET "
            "node = ?2, epoch = ?3, number = old.number + 1, body = ?4 WHERE old.epoch <= ?3"));
        rows.bind(state.robot_id).bind(state.node).bind(state.epoch);
        rows.bind(std::span<const std::byte>(state.body)).run_later();
      }
      transaction.commit();
      return {};
    });
  }

  Result<std::vector<LiveState>> news(const std::string& own_node) override {
    return work([&](Database& database) -> Result<std::vector<LiveState>> {
      std::vector<std::string> changed;
      std::map<std::string, Mark> marks;
      {
        Rows rows(database.statement("SELECT robot_id, epoch, number FROM cluster_live WHERE node <> ?"));
        rows.bind(own_node);
        while (rows.next()) {
          std::string robot_id = rows.text();
          Mark mark;
          mark.epoch = rows.integer();
          mark.number = rows.integer();
          const auto seen = seen_.find(robot_id);
          if (seen == seen_.end() || seen->second.epoch != mark.epoch || seen->second.number != mark.number)
            changed.push_back(robot_id);
          marks.emplace(std::move(robot_id), mark);
        }
      }
      std::vector<LiveState> news;
      if (!changed.empty()) {
        const std::string names = nlohmann::json(changed).dump();
        Rows rows(
            database.statement("SELECT robot_id, node, epoch, body FROM cluster_live WHERE node <> ? AND "
                               "robot_id IN (SELECT json_array_elements_text(?::json))"));
        rows.bind(own_node).bind(names);
        while (rows.next()) {
          LiveState& state = news.emplace_back();
          state.robot_id = rows.text();
          state.node = rows.text();
          state.epoch = rows.integer();
          const auto body = rows.blob();
          state.body.assign(body.begin(), body.end());
        }
      }
      seen_ = std::move(marks);
      return news;
    });
  }

  Result<std::map<std::string, std::optional<std::int64_t>>> active_models() override {
    return work([&](Database& database) -> Result<std::map<std::string, std::optional<std::int64_t>>> {
      std::map<std::string, std::optional<std::int64_t>> models;
      for (Rows rows(database.statement("SELECT robot_id, active_version FROM robot")); rows.next();) {
        std::string robot_id = rows.text();
        models.emplace(std::move(robot_id), rows.optional_integer());
      }
      return models;
    });
  }

  Result<std::map<std::string, std::int64_t>> learned(const std::string& topic) override {
    return work([&](Database& database) -> Result<std::map<std::string, std::int64_t>> {
      std::map<std::string, std::int64_t> times;
      Rows rows(database.statement("SELECT robot_id, utime_us FROM learned WHERE topic = ?"));
      rows.bind(topic);
      while (rows.next()) {
        std::string robot_id = rows.text();
        times.emplace(std::move(robot_id), rows.integer());
      }
      return times;
    });
  }

 private:
  struct Mark {
    Epoch epoch = 0;
    std::int64_t number = 0;
  };

  template <class Work>
  auto work(Work work) -> decltype(work(std::declval<Database&>())) {
    return guarded([&] {
      if (!database_ || !database_->is_usable()) {
        database_.reset();
        database_ = std::make_unique<PostgresDatabase>(url_, name_);
        // Live states are published again in a moment: a commit need not wait for the disk.
        database_->execute("SET synchronous_commit = off; SET statement_timeout = '5s'");
      }
      return work(*database_);
    });
  }

  const std::string url_, name_;
  std::unique_ptr<PostgresDatabase> database_;
  std::map<std::string, Mark> seen_;
};

}  // namespace

std::unique_ptr<SharedState> open_shared_state(const std::string& url, const std::string& application_name) {
  return std::make_unique<PostgresSharedState>(url, application_name);
}

}  // namespace joulecast::history
