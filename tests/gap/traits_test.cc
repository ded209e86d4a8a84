#include "gap/traits.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "dynamics/catalogue.h"

namespace joulecast::gap {
namespace {

TEST(Traits, HasOneRowPerEffect) {
  EXPECT_EQ(traits_table.size(), dynamics::catalogue().size());
  for (const dynamics::Effect* effect : dynamics::catalogue())
    EXPECT_EQ(std::ranges::count(traits_table, effect->info().id, &Traits::id), 1) << effect->info().id;
}

}  // namespace
}  // namespace joulecast::gap
