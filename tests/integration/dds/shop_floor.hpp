#pragma once
/// abbed's stand-in with its abbe-dds, and subscribers, on a DDS domain that no other process uses
/// at the moment.

#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>

#include "abbe/messages/dds_security.hpp"
#include "domain_claim.hpp"
#include "feeder_command.hpp"
#include "process.hpp"
#include "sample_messages.hpp"

namespace abbe::test {

class ShopFloor : public testing::Test {
 protected:
  /// `domains`: how many that follow each other no other test may use.
  explicit ShopFloor(int domains = 1) : domain_(domains) {
    ::setenv("CYCLONEDDS_URI", "file://" ABBE_CYCLONE_CONFIG, 1);
    std::string name = testing::TempDir() + "abbe-dds-XXXXXX";
    directory_ = ::mkdtemp(name.data());
  }
  ~ShopFloor() override {
    feeder_.reset();
    std::filesystem::remove_all(directory_);
  }

  /// `more`: further arguments of abbe-dds.
  void start_feeder(const std::vector<std::string>& more = {}) {
    feeder_ = feeder_of(kMachine, more);
  }

  [[nodiscard]] std::unique_ptr<Process> feeder_of(
      const std::string& machine, const std::vector<std::string>& more = {}) const {
    return std::make_unique<Process>(
        feeder_command(directory_, machine, domain_.text(), profile_, more));
  }

  [[nodiscard]] std::vector<std::string> watch(std::vector<std::string> options) const {
    std::vector<std::string> command{ABBE_WATCH_PROGRAM, "--domain", domain_.text(), "--profile",
                                     ABBE_LOOPBACK_PROFILE};
    command.insert(command.end(), options.begin(), options.end());
    return command;
  }
  [[nodiscard]] std::vector<std::string> fast_subscriber() const {
    return {ABBE_FAST_SUBSCRIBER, domain_.text(), ABBE_LOOPBACK_PROFILE};
  }
  [[nodiscard]] std::vector<std::string> cyclone_subscriber() const {
    return {ABBE_CYCLONE_SUBSCRIBER, domain_.text()};
  }

  /// Keys of a new authority, for abbe-dds and two subscribers.
  [[nodiscard]] std::filesystem::path make_keys(const char* name) const {
    const auto folder = directory_ / name;
    const auto made = daemon::make_dds_keys({.folder = folder, .subscribers = 2},
                                            std::chrono::system_clock::now());
    EXPECT_TRUE(made) << made.error().text;
    return folder;
  }

  /// abbe-dds as the supervisor last announced it.
  pid_t abbe_dds_pid() { return abbe_dds_pid(*feeder_); }
  static pid_t abbe_dds_pid(Process& feeder) {
    EXPECT_TRUE(feeder.wait_for("child"));
    pid_t pid = 0;
    for (const Line& line : feeder.lines()) {
      if (line.text.starts_with("child ")) pid = std::stoi(line.text.substr(6));
    }
    return pid;
  }

  DomainClaim domain_;
  std::filesystem::path directory_;
  std::string profile_ = ABBE_LOOPBACK_PROFILE;  ///< of abbe-dds
  std::unique_ptr<Process> feeder_;
};

}  // namespace abbe::test
