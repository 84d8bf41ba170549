#include "abbe/protocol/visit.hpp"

#include <gtest/gtest.h>

namespace abbe::protocol {
namespace {

TEST(VisitTrivial, FindsTheFirstTheMiddleAndTheLastAlternative) {
  using Any = std::variant<int, double, char>;
  const auto size = [](auto value) { return sizeof value; };
  EXPECT_EQ(visit_trivial(size, Any{1}), sizeof(int));
  EXPECT_EQ(visit_trivial(size, Any{1.0}), sizeof(double));
  EXPECT_EQ(visit_trivial(size, Any{'a'}), sizeof(char));
}

}  // namespace
}  // namespace abbe::protocol
