#include "abbe/web/page_places.hpp"

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <string>

namespace abbe::web {
namespace {

using namespace std::chrono_literals;
using Place = PagePlaces::Place;

struct PagePlacesTest : ::testing::Test {
  PagePlaces places{4};
  PagePlaces::Clock::time_point start{};
  std::array<PagePlaces::Held, 8> held;

  void open(std::size_t page, const std::string& address) {
    EXPECT_EQ(places.take(address, start, held.at(page)), Place::Taken);
  }
};

TEST_F(PagePlacesTest, APageThatReportsKeepsItsPlace) {
  for (std::size_t page = 0; page < 4; ++page) open(page, page < 2 ? "a" : "b");
  for (std::size_t page = 0; page < 4; ++page)
    places.report_reading(held[page].number(), start + 1s);
  EXPECT_EQ(places.take("c", start + 1s + PagePlaces::kNextReport, held[4]), Place::AllTaken);
  for (std::size_t page = 0; page < 4; ++page) EXPECT_FALSE(held[page].lost()) << page;
}

TEST_F(PagePlacesTest, APageThatHasNotReportedLosesItsPlaceToANewOne) {
  for (std::size_t page = 0; page < 4; ++page) open(page, page < 2 ? "a" : "b");
  for (const std::size_t page : {0, 1, 3}) places.report_reading(held[page].number(), start + 1s);
  EXPECT_EQ(places.take("c", start + PagePlaces::kFirstReport, held[4]), Place::AllTaken);
  EXPECT_EQ(places.take("c", start + PagePlaces::kFirstReport + 1ms, held[4]), Place::Taken);
  EXPECT_TRUE(held[2].lost());
  EXPECT_EQ(places.taken(), 4U);
  EXPECT_EQ(places.take("c", start + PagePlaces::kFirstReport + 2ms, held[5]), Place::AllTaken);
}

TEST_F(PagePlacesTest, APageThatStoppedReportingLosesItsPlace) {
  for (std::size_t page = 0; page < 4; ++page) open(page, page < 2 ? "a" : "b");
  for (std::size_t page = 0; page < 4; ++page)
    places.report_reading(held[page].number(), start + 1s);
  for (std::size_t page = 1; page < 4; ++page)
    places.report_reading(held[page].number(), start + 9s);
  EXPECT_EQ(places.take("c", start + 2s + PagePlaces::kNextReport, held[4]), Place::Taken);
  EXPECT_TRUE(held[0].lost());
}

TEST_F(PagePlacesTest, AnAddressAtItsLimitGetsOnlyThePlaceOfAPageOfItsOwn) {
  for (std::size_t page = 0; page < 3; ++page) open(page, "a");
  open(3, "b");
  for (std::size_t page = 0; page < 3; ++page)
    places.report_reading(held[page].number(), start + 3s);
  EXPECT_EQ(places.take("a", start + 4s, held[4]), Place::AllOfAddressTaken);
  EXPECT_FALSE(held[3].lost());
  EXPECT_EQ(places.take("c", start + 4s, held[4]), Place::Taken);
  EXPECT_TRUE(held[3].lost());
}

}  // namespace
}  // namespace abbe::web
