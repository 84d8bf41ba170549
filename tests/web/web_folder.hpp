#pragma once
/// A folder with a configuration, a model store and users, for tests of the page.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "abbe/config/web_config.hpp"
#include "abbe/web/web_users.hpp"
#include "config_tables.hpp"

namespace abbe::web::test {

inline const std::string kPassword = "a long password";

class WebFolder : public ::testing::Test {
 protected:
  WebFolder() {
    std::string name = ::testing::TempDir() + "abbe-web-XXXXXX";
    folder_ = ::mkdtemp(name.data());
    write_config("");
  }
  ~WebFolder() override { std::filesystem::remove_all(folder_); }

  /// `web`: lines of the table [web].
  void write_config(const std::string& web) const {
    write("abbed.toml", to_toml(config_tables::mill()) +
                            "[daemon]\ndata_dir = \"data\"\nruntime_dir = \"run\"\n[web]\n" + web);
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream{folder_ / name, std::ios::binary} << text;
  }
  [[nodiscard]] std::string text_of(const std::string& name) const {
    std::ifstream file{folder_ / name, std::ios::binary};
    return {std::istreambuf_iterator<char>{file}, {}};
  }
  /// One user for each role, with the name of the role.
  void write_users() const {
    std::string lines;
    for (const WebRole role : {WebRole::View, WebRole::Calibrate, WebRole::Administer})
      lines += web_user_line(std::string{name(role)}, role, kPassword).value() + "\n";
    write("users", lines);
    ::chmod((folder_ / "users").c_str(), 0640);
  }
  [[nodiscard]] daemon::Result<daemon::WebSettings> settings() const {
    return daemon::load_web_settings(folder_ / "abbed.toml");
  }

  std::filesystem::path folder_;
};

}  // namespace abbe::web::test
