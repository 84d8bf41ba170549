#include "abbe/model/machine_identity.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <fstream>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr protocol::UtcTime kDay{20'000h * 24};

/// A data folder and, beside it, the files from which a computer is recognised.
class MachineIdentityTest : public testing::Test {
 protected:
  MachineIdentityTest() {
    std::string name = testing::TempDir() + "abbe-identity-XXXXXX";
    folder_ = ::mkdtemp(name.data());
  }
  ~MachineIdentityTest() override { fs::remove_all(folder_); }

  static void write(const fs::path& file, const std::string& text) {
    fs::create_directories(file.parent_path());
    std::ofstream{file} << text << '\n';
  }
  fs::path computer(const char* name, const std::string& machine_id,
                    const std::vector<std::string>& addresses = {}, const char* bus = "pci") {
    const fs::path root = folder_ / name;
    if (!machine_id.empty()) write(root / "etc/machine-id", machine_id);
    for (std::size_t i = 0; i < addresses.size(); ++i) {
      const auto interface = root / "sys/class/net" / ("eth" + std::to_string(i));
      write(interface / "address", addresses[i]);
      fs::create_directories(root / "bus" / bus);
      fs::create_directories(interface / "device");
      fs::create_directory_symlink(root / "bus" / bus, interface / "device/subsystem");
    }
    return root;
  }
  ComputerMarks marks(const char* name, const std::string& machine_id,
                      const std::vector<std::string>& addresses = {}, const char* bus = "pci") {
    return marks_of_this_computer(computer(name, machine_id, addresses, bus));
  }

  fs::path folder_;
};

constexpr const char* kCard = "00:1b:21:3a:00:01";
constexpr const char* kOtherCard = "00:1b:21:3a:00:02";

TEST_F(MachineIdentityTest, IsMadeOnceAndStays) {
  const fs::path data = folder_ / "data";
  const auto here = marks("a", "4711", {kCard});
  const auto made = open_identity(data, here, kDay);
  ASSERT_TRUE(made) << made.error().text;
  EXPECT_EQ(made->machine_id.size(), 36u);
  const auto again = open_identity(data, here, kDay + 24h);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->machine_id, made->machine_id);
  EXPECT_EQ(again->events, made->events);
  EXPECT_EQ(why_not_confirmed(*again, here), "");
  EXPECT_NE(open_identity(folder_ / "other", here, kDay)->machine_id, made->machine_id);
}

TEST_F(MachineIdentityTest, TheFileDoesNotDiscloseWhatIdentifiesTheComputer) {
  const fs::path data = folder_ / "data";
  ASSERT_TRUE(open_identity(data, marks("a", "0123456789abcdef", {kCard}), kDay));
  std::ifstream file{identity_file(data)};
  const std::string text{std::istreambuf_iterator<char>{file}, {}};
  EXPECT_EQ(text.find("0123456789abcdef"), std::string::npos);
  EXPECT_EQ(text.find(kCard), std::string::npos);
}

TEST_F(MachineIdentityTest, ACopiedFolderIsNoticedOnAnotherComputer) {
  const auto identity = open_identity(folder_ / "data", marks("a", "4711", {kCard}), kDay).value();
  EXPECT_THAT(why_not_confirmed(identity, marks("b", "4712", {kOtherCard})),
              HasSubstr("belongs to another computer"));
}

TEST_F(MachineIdentityTest, AClonedDiskIsNoticedByTheNetworkCards) {
  const auto identity = open_identity(folder_ / "data", marks("a", "4711", {kCard}), kDay).value();
  EXPECT_NE(why_not_confirmed(identity, marks("b", "4711", {kOtherCard})), "");
}

TEST_F(MachineIdentityTest, OneOfTwoNetworkCardsMayBeReplaced) {
  const auto identity =
      open_identity(folder_ / "data", marks("a", "4711", {kCard, kOtherCard}), kDay).value();
  EXPECT_EQ(why_not_confirmed(identity, marks("b", "4711", {kOtherCard, "00:1b:21:3a:00:03"})), "");
}

/// Containers, virtual bridges, and adapters that are plugged in and out.
TEST_F(MachineIdentityTest, WhatIsNotOfTheComputerDoesNotCount) {
  EXPECT_EQ(marks("usb", "", {kCard}, "usb"), ComputerMarks{});
  EXPECT_EQ(marks("random", "", {"02:42:ac:11:00:02", "00:00:00:00:00:00"}), ComputerMarks{});
  EXPECT_EQ(marks("nothing", "uninitialized"), ComputerMarks{});
  const auto identity = open_identity(folder_ / "data", marks("a", "4711", {kCard}), kDay).value();
  EXPECT_EQ(why_not_confirmed(identity, {}), "");
}

TEST_F(MachineIdentityTest, KeepBindsTheIdentityToTheNewComputer) {
  const fs::path data = folder_ / "data";
  const auto before = open_identity(data, marks("a", "4711", {kCard}), kDay).value();
  const auto there = marks("b", "4712", {kOtherCard});
  const auto kept = decide_identity(
      data, there, {.action = IdentityAction::Kept, .who = "anna", .why = "new PC", .when = kDay});
  ASSERT_TRUE(kept) << kept.error().text;
  EXPECT_EQ(kept->machine_id, before.machine_id);
  const auto read = open_identity(data, there, kDay).value();
  EXPECT_EQ(why_not_confirmed(read, there), "");
  EXPECT_EQ(read.renewal(), nullptr);
  ASSERT_EQ(read.events.size(), 2u);
  EXPECT_EQ(read.events[1].who, "anna");
  EXPECT_EQ(read.events[1].why, "new PC");
}

TEST_F(MachineIdentityTest, NewMakesAnotherMachineAndSaysSinceWhen) {
  const fs::path data = folder_ / "data";
  const auto before = open_identity(data, marks("a", "4711", {kCard}), kDay).value();
  const auto there = marks("b", "4712", {kOtherCard});
  const auto renewed = decide_identity(
      data, there,
      {.action = IdentityAction::Renewed, .who = "anna", .why = "", .when = kDay + 1h});
  ASSERT_TRUE(renewed) << renewed.error().text;
  EXPECT_NE(renewed->machine_id, before.machine_id);
  const auto read = open_identity(data, there, kDay).value();
  ASSERT_NE(read.renewal(), nullptr);
  EXPECT_EQ(read.renewal()->when, kDay + 1h);
  EXPECT_EQ(read.renewal()->store, StorePlace{});
  EXPECT_EQ(read.machine_id_at(kDay - 24h), before.machine_id);
  EXPECT_EQ(read.machine_id_at(kDay + 30min), before.machine_id);
  EXPECT_EQ(read.machine_id_at(kDay + 1h), read.machine_id);
  EXPECT_EQ(read.events[0].machine_id, before.machine_id);
  EXPECT_EQ(read.events[1].machine_id, read.machine_id);
}

TEST_F(MachineIdentityTest, AModelIsOfTheMachineByItsPlaceInTheStoreAndNotByItsDate) {
  const auto event = [](StoreAction action, const char* id) {
    return StoreEvent{.action = action, .id = id, .actor = {"tester", "", kDay}};
  };
  std::vector history{event(StoreAction::Added, "a"), event(StoreAction::Activated, "a")};
  const MachineIdentity identity{.machine_id = "new",
                                 .events = {{.machine_id = "old"},
                                            {.action = IdentityAction::Renewed,
                                             .machine_id = "new",
                                             .when = kDay + 24h,
                                             .store = end_of(history)}}};
  history.push_back(event(StoreAction::Added, "b"));
  history.push_back(event(StoreAction::Activated, "b"));
  history.push_back(event(StoreAction::RolledBack, "a"));
  EXPECT_EQ(models_of_other_machine(identity, history), std::vector<std::string>{"a"});
  EXPECT_EQ(machine_id_of_model(identity, history, "a"), "old");
  EXPECT_EQ(machine_id_of_model(identity, history, "b"), "new");
}

TEST_F(MachineIdentityTest, ADamagedFileIsRefusedAndCanBeRenewed) {
  const fs::path data = folder_ / "data";
  const auto here = marks("a", "4711");
  for (const char* text : {"", "{}", R"({"schema":"abbe/identity/1","machine_id":7})",
                           R"({"schema":"abbe/identity/1","machine_id":"x","computer":{"machine_id":
                           "","interfaces":[]},"events":[]})"}) {
    write(identity_file(data), text);
    EXPECT_FALSE(open_identity(data, here, kDay)) << text;
    EXPECT_FALSE(decide_identity(data, here, {.action = IdentityAction::Kept})) << text;
  }
  EXPECT_TRUE(decide_identity(data, here, {.action = IdentityAction::Renewed}));
  EXPECT_TRUE(open_identity(data, here, kDay));
}

TEST_F(MachineIdentityTest, AnIdentityThatDoesNotExistCannotBeKept) {
  EXPECT_FALSE(decide_identity(folder_ / "data", {}, {.action = IdentityAction::Kept}));
}

}  // namespace
}  // namespace abbe::daemon
