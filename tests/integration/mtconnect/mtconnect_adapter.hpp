#pragma once
/// abbe-mtconnect beside an abbed, with or without simulated devices.

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <regex>
#include <string>

#include "abbe/config/config.hpp"
#include "abbe/model/model_store.hpp"
#include "spine.hpp"
#include "synthetic_model.hpp"

namespace abbe::test {

class MtconnectAdapter : public Spine {
 protected:
  void start_adapter() {
    adapter_ = start({ABBE_MTCONNECT_PROGRAM, "--config", file("abbed.toml")}, "mtconnect");
    ASSERT_TRUE(eventually([this] { return listening_port() != 0 || !adapter_->running(); }));
    ASSERT_NE(listening_port(), 0) << adapter_->err();
  }
  [[nodiscard]] std::uint16_t listening_port() const {
    std::smatch match;
    const std::string log = adapter_->err();
    return std::regex_search(log, match, std::regex{"listening at 127.0.0.1, port (\\d+)\n"})
               ? static_cast<std::uint16_t>(std::stoi(match[1]))
               : 0;
  }
  /// Without a simulator the devices are away: nothing answers at port 1.
  void configure() {
    if (tracker_port_ == 0) tracker_port_ = can_port_ = 1;
    write_configuration();
    write("abbed.toml", text_of(file("abbed.toml")) + "[mtconnect]\nport = 0\nheartbeat_s = 1.5\n");
  }
  /// Puts a model for this machine into the store and activates it.
  daemon::ModelDocument activate_a_model() {
    const auto config = daemon::load_config(file("abbed.toml")).value();
    auto document = daemon::test::synthetic_document(1);
    document.machine_hash = daemon::machine_hash(config);
    auto store = daemon::ModelStore::open(config.daemon.data_dir / "models").value();
    const daemon::StoreActor anna{"anna", "for the test", document.created};
    const auto id = store.add(document, true, {}, anna).value();
    EXPECT_TRUE(store.activate(id, anna));
    return document;
  }

  std::unique_ptr<Program> adapter_;
};

}  // namespace abbe::test
