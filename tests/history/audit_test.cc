#include "history/audit.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "history/sqlite.h"
#include "temporary_store.h"

namespace joulecast::history {
namespace {

class AuditTest : public ::testing::Test {
 protected:
  AuditTest() {
    store_ = need(open_store(path_));
    // Few enough for one page, so that no stale copy of an entry is in the file.
    for (int k = 0; k < 12; ++k) append("carol-" + std::to_string(k));
  }

  void append(const std::string& actor) {
    need(apply_one(*store_, AppendAudit{{0, 1'790'000'000'000'000 + ++time_, actor, "192.0.2.7", "r-1",
                                         "putRobot", R"({"path":"/v1/robots/amr"})", ""}}));
  }

  // The store's file without its journal, as the daemon leaves it.
  void close() { store_.reset(); }

  std::string bytes() const {
    std::ifstream file(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void write(const std::string& bytes) const { std::ofstream(path_, std::ios::binary) << bytes; }
  void run(const std::string& sql) const {
    SqliteDatabase(path_, OpenMode::read_write_create, 1000).execute(sql);
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.file("history.db");
  std::unique_ptr<Store> store_;
  int time_ = 0;
};

TEST_F(AuditTest, ChainIsValidOpenAndClosed) {
  std::vector<AuditEntry> entries;
  const auto state = verify_audit(path_, {}, [&](const AuditEntry& entry) { entries.push_back(entry); });
  ASSERT_TRUE(state) << describe(state.error());
  EXPECT_EQ(state->entries, 12);
  ASSERT_EQ(entries.size(), 12U);
  EXPECT_EQ(entries[4].actor, "carol-4");
  EXPECT_EQ(entries[4].address, "192.0.2.7");
  EXPECT_EQ(entries.back().hash, state->head);
  close();
  EXPECT_EQ(verify_audit(path_)->head, state->head);
}

TEST_F(AuditTest, DetectsOneChangedByte) {
  close();
  const std::string whole = bytes();
  const std::size_t place = whole.find("carol-7");
  ASSERT_NE(place, std::string::npos);
  for (const std::size_t at : {place, place + 6, whole.find("amr", place), whole.find("192", place) + 8}) {
    std::string changed = whole;
    changed[at] = static_cast<char>(changed[at] ^ 1);
    write(changed);
    const auto state = verify_audit(path_);
    ASSERT_FALSE(state) << at;
    EXPECT_EQ(state.error().fault, Fault::corrupt);
    EXPECT_NE(state.error().message.find("at entry 8"), std::string::npos) << state.error().message;
  }
  write(whole);
  EXPECT_TRUE(verify_audit(path_));
}

TEST_F(AuditTest, IsOnlyAppendedTo) {
  close();
  EXPECT_THROW(run("UPDATE audit SET actor = 'mallory' WHERE audit_id = 3"), SqlError);
  EXPECT_THROW(run("DELETE FROM audit WHERE audit_id = 3"), SqlError);
  EXPECT_TRUE(verify_audit(path_));
}

TEST_F(AuditTest, DetectsRemovalWithoutTheTriggers) {
  close();
  run("DROP TRIGGER audit_keeps_entries; DELETE FROM audit WHERE audit_id = 5");
  const auto removed = verify_audit(path_);
  ASSERT_FALSE(removed);
  EXPECT_NE(removed.error().message.find("entry 5, which is missing"), std::string::npos);
}

TEST_F(AuditTest, RetentionKeepsBrokenLinks) {
  const auto prune = [&] { return apply_one(*store_, PruneAudit{1'000'000, 5}); };
  run("DROP TRIGGER audit_keeps_content; UPDATE audit SET actor = 'mallory' WHERE audit_id = 3");
  const auto refused = prune();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::corrupt);
  EXPECT_EQ(need(store_->size()).audit_entries, 12);
  run("UPDATE audit SET actor = 'carol-2' WHERE audit_id = 3");
  EXPECT_EQ(need(prune()), 5);
  EXPECT_THROW(run("DELETE FROM audit WHERE audit_id = 6"), SqlError) << "the trigger is there again";
  ASSERT_TRUE(verify_audit(path_));
  close();
  // Entries behind those that are stated as removed.
  run("DROP TRIGGER audit_keeps_entries; DELETE FROM audit WHERE audit_id = 6");
  const auto removed = verify_audit(path_);
  ASSERT_FALSE(removed);
  EXPECT_NE(removed.error().message.find("entry 6, which is missing"), std::string::npos);
}

TEST_F(AuditTest, DetectsEntryWithLeastNumber) {
  close();
  run("INSERT INTO audit VALUES (-9223372036854775808, 1, 'mallory', '', '', 'putRobot', '{}', '" +
      std::string(64, '0') + "')");
  EXPECT_FALSE(verify_audit(path_));
}

TEST_F(AuditTest, NotedHeadDetectsTruncation) {
  const std::string head = verify_audit(path_)->head;
  append("dave");
  EXPECT_TRUE(verify_audit(path_, head)) << "an older head is within the chain";
  close();
  run("DROP TRIGGER audit_keeps_entries; DELETE FROM audit WHERE audit_id > 10");
  EXPECT_TRUE(verify_audit(path_)) << "the remaining entries form a chain";
  EXPECT_FALSE(verify_audit(path_, head));
}

TEST_F(AuditTest, RejectsOtherFiles) {
  EXPECT_EQ(verify_audit(folder_.file("absent.db")).error().fault, Fault::not_found);
  const std::string other = folder_.file("other.db");
  std::ofstream(other) << "not a database, but long enough to be looked at";
  EXPECT_FALSE(verify_audit(other));
  SqliteDatabase(folder_.file("foreign.db"), OpenMode::read_write_create, 100)
      .execute("CREATE TABLE audit (x)");
  EXPECT_EQ(verify_audit(folder_.file("foreign.db")).error().fault, Fault::corrupt);
  close();
  EXPECT_TRUE(verify_audit(path_));
  run("PRAGMA user_version = 1");
  EXPECT_EQ(verify_audit(path_).error().fault, Fault::conflict);
}

}  // namespace
}  // namespace joulecast::history
