// Runs a network of moving nodes in ns-3 and prints what arrived. scripts/compare builds and calls it.
//
// Standard input: "ROUTING RUN SECONDS TX_DBM NODES", then lines "w NODE T_S X_M Y_M", the waypoints in
// order of time, and "f FROM TO START_S END_S PERIOD_S BYTES", the flows of UDP messages. The radio has
// the parameters of ns-3's example manet-routing-compare: 802.11b, all frames at 11 Mb/s, Friis loss.
// Standard output: "FRAMES CORE_S", then for each message that arrived its delay in seconds.

#include <ctime>
#include <iostream>

#include "ns3/aodv-module.h"
#include "ns3/applications-module.h"
#include "ns3/core-module.h"
#include "ns3/dsdv-module.h"
#include "ns3/internet-module.h"
#include "ns3/mobility-module.h"
#include "ns3/network-module.h"
#include "ns3/olsr-module.h"
#include "ns3/wifi-module.h"

using namespace ns3;

static uint64_t frames = 0;
static std::vector<double> delays_s;

static void Sent(Ptr<const Packet>, double) { ++frames; }

static void Arrived(Ptr<const Packet> packet) {
  SeqTsHeader stamp;
  packet->PeekHeader(stamp);
  delays_s.push_back((Simulator::Now() - stamp.GetTs()).GetSeconds());
}

static NetDeviceContainer Radios(NodeContainer nodes, double tx_dbm) {
  const StringValue rate("DsssRate11Mbps");
  Config::SetDefault("ns3::WifiRemoteStationManager::NonUnicastMode", rate);
  YansWifiChannelHelper space;
  space.SetPropagationDelay("ns3::ConstantSpeedPropagationDelayModel");
  space.AddPropagationLoss("ns3::FriisPropagationLossModel");
  YansWifiPhyHelper phy;
  phy.SetChannel(space.Create());
  phy.Set("TxPowerStart", DoubleValue(tx_dbm));
  phy.Set("TxPowerEnd", DoubleValue(tx_dbm));
  WifiMacHelper mac;
  mac.SetType("ns3::AdhocWifiMac");
  WifiHelper wifi;
  wifi.SetStandard(WIFI_STANDARD_80211b);
  wifi.SetRemoteStationManager("ns3::ConstantRateWifiManager", "DataMode", rate, "ControlMode", rate);
  NetDeviceContainer radios = wifi.Install(phy, mac, nodes);
  for (uint32_t i = 0; i < radios.GetN(); ++i) {
    auto radio = DynamicCast<WifiNetDevice>(radios.Get(i))->GetPhy();
    radio->TraceConnectWithoutContext("PhyTxBegin", MakeCallback(&Sent));
  }
  return radios;
}

int main() {
  std::string routing, kind;
  uint32_t run, count, from, to, bytes;
  double until_s, tx_dbm, start_s, end_s, period_s, x_m, y_m;
  std::cin >> routing >> run >> until_s >> tx_dbm >> count;
  RngSeedManager::SetRun(run);
  NodeContainer nodes(count);
  MobilityHelper mobility;
  mobility.SetMobilityModel("ns3::WaypointMobilityModel");
  mobility.Install(nodes);
  NetDeviceContainer radios = Radios(nodes, tx_dbm);
  InternetStackHelper internet;
  if (routing == "AODV") internet.SetRoutingHelper(AodvHelper());
  if (routing == "OLSR") internet.SetRoutingHelper(OlsrHelper());
  if (routing == "DSDV") internet.SetRoutingHelper(DsdvHelper());
  internet.Install(nodes);
  Ipv4InterfaceContainer addresses = Ipv4AddressHelper("10.1.0.0", "255.255.0.0").Assign(radios);

  for (uint16_t port = 1000; std::cin >> kind; ++port) {
    if (kind == "w") {
      std::cin >> from >> start_s >> x_m >> y_m;
      const Waypoint waypoint(Seconds(start_s), Vector(x_m, y_m, 0.0));
      nodes.Get(from)->GetObject<WaypointMobilityModel>()->AddWaypoint(waypoint);
      continue;
    }
    std::cin >> from >> to >> start_s >> end_s >> period_s >> bytes;
    UdpClientHelper source(addresses.GetAddress(to), port);
    source.SetAttribute("Interval", TimeValue(Seconds(period_s)));
    source.SetAttribute("PacketSize", UintegerValue(bytes));
    source.SetAttribute("MaxPackets", UintegerValue(std::ceil((end_s - start_s) / period_s)));
    source.Install(nodes.Get(from)).Start(Seconds(start_s));
    ApplicationContainer sink = UdpServerHelper(port).Install(nodes.Get(to));
    sink.Get(0)->TraceConnectWithoutContext("Rx", MakeCallback(&Arrived));
  }

  Simulator::Stop(Seconds(until_s));
  const std::clock_t begun = std::clock();
  Simulator::Run();
  std::cout << frames << ' ' << double(std::clock() - begun) / CLOCKS_PER_SEC << '\n';
  for (double delay_s : delays_s) std::cout << delay_s << '\n';
  Simulator::Destroy();
}
