#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "history/open_store.h"
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
  Result<void> run(const Work& work) const override {
    before_read();
    return store_->run(work);
  }
  Result<StoreSize> size() const override { return store_->size(); }

 protected:
  static std::unique_ptr<Store> open_at(const std::string& path) { return need(open_store(path)); }
  virtual void before_read() const {}

  std::unique_ptr<Store> store_;
};

}  // namespace joulecast::history
