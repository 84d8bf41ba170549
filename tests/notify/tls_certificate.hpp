#pragma once
/// A certificate for 127.0.0.1 that signs itself, and its key, in a folder that goes with the test.

#include <gtest/gtest.h>
#include <stdlib.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace abbe::test {

struct TlsFolder : ::testing::Test {
  TlsFolder() {
    std::string name = testing::TempDir() + "abbe-notify-XXXXXX";
    folder_ = ::mkdtemp(name.data());
  }
  ~TlsFolder() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::string certificate() const { return folder_ / "cert.pem"; }
  [[nodiscard]] std::string key() const { return folder_ / "key.pem"; }
  void write_certificate() const {
    const std::string command =
        "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 "
        "-subj /CN=localhost -addext subjectAltName=IP:127.0.0.1 -keyout " +
        key() + " -out " + certificate() + " 2>/dev/null";
    ASSERT_EQ(std::system(command.c_str()), 0);  // NOLINT: the names are those of this test
  }

  std::filesystem::path folder_;
};

}  // namespace abbe::test
