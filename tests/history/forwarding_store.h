#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "history/sqlite_store.h"
#include "tests/history/temporary_store.h"

namespace joulecast::history {

// A real store; tests override what is to be different.
class ForwardingStore : public Store {
 public:
  explicit ForwardingStore(std::unique_ptr<Store> real) : store_(std::move(real)) {}

  Result<std::vector<Outcome>> apply(std::span<const Command> commands) override {
    return store_->apply(commands);
  }
  BatchMark mark() const override { return store_->mark(); }
  Result<MissionKey> new_mission_key() override { return store_->new_mission_key(); }
  Result<std::vector<RobotRecord>> robots() const override { return store().robots(); }
  Result<ModelVersion> model(std::string_view r, std::optional<std::int64_t> v) const override {
    return store().model(r, v);
  }
  Result<std::vector<ModelVersion>> model_versions(std::string_view r) const override {
    return store().model_versions(r);
  }
  Result<Mission> mission(MissionKey key) const override { return store().mission(key); }
  Result<MissionPage> missions(const MissionFilter& f, const PageRequest& p, MissionSort s) const override {
    return store().missions(f, p, s);
  }
  Result<Totals> totals(const MissionFilter& f) const override { return store().totals(f); }
  Result<FloorReading> floor_visits(const MissionFilter& f, double c, std::int64_t p,
                                    const FloorSink& sink) const override {
    return store().floor_visits(f, c, p, sink);
  }
  Result<std::vector<TotalsGroup>> grouped_totals(const MissionFilter& f, Grouping by,
                                                  std::int64_t utc_offset_s) const override {
    return store().grouped_totals(f, by, utc_offset_s);
  }
  Result<Trace> trace(MissionKey k, TimeRange r, std::int64_t n) const override {
    return store().trace(k, r, n);
  }
  Result<CovariatePage> covariates(MissionKey k, TimeRange r, const PageRequest& p) const override {
    return store().covariates(k, r, p);
  }
  Result<TelemetryPage> telemetry(MissionKey k, TimeRange r, const PageRequest& p) const override {
    return store().telemetry(k, r, p);
  }
  Result<std::optional<RequestAnswer>> answer(std::string_view a, std::string_view k) const override {
    return store().answer(a, k);
  }
  Result<std::vector<AuditEntry>> audit(std::int64_t a, std::int64_t n, const LogFilter& f) const override {
    return store().audit(a, n, f);
  }
  Result<std::vector<Event>> events(std::int64_t a, std::int64_t n, const LogFilter& f) const override {
    return store().events(a, n, f);
  }
  Result<std::vector<FloorPlan>> floor_plans() const override { return store().floor_plans(); }
  Result<FloorPlan> floor_plan(std::string_view m, std::string_view l) const override {
    return store().floor_plan(m, l);
  }
  Result<std::optional<Learned>> learned(std::string_view r, std::string_view topic) const override {
    return store().learned(r, topic);
  }
  Result<std::vector<Learned>> all_learned(std::string_view topic) const override {
    return store().all_learned(topic);
  }
  Result<std::optional<ResumeState>> resume_state(std::string_view r) const override {
    return store().resume_state(r);
  }
  Result<DiagnosisRecord> diagnosis(std::int64_t id) const override { return store().diagnosis(id); }
  Result<std::vector<DiagnosisRecord>> diagnoses(std::optional<std::string> r, std::int64_t b,
                                                 std::int64_t n) const override {
    return store().diagnoses(r, b, n);
  }
  Result<std::string> diagnosis_report(std::int64_t id) const override {
    return store().diagnosis_report(id);
  }
  Result<Proposal> proposal(std::int64_t id) const override { return store().proposal(id); }
  Result<std::vector<Proposal>> proposals(std::optional<std::string> r, std::int64_t b,
                                          std::int64_t n) const override {
    return store().proposals(r, b, n);
  }
  Result<std::vector<Mission>> recover() const override { return store().recover(); }
  Result<StoreSize> size() const override { return store().size(); }

 protected:
  static std::unique_ptr<Store> open_at(const std::string& path) {
    SqliteOptions options;
    options.path = path;
    return need(open_sqlite_store(options));
  }
  virtual void before_read() const {}

  std::unique_ptr<Store> store_;

 private:
  const Store& store() const {
    before_read();
    return *store_;
  }
};

}  // namespace joulecast::history
