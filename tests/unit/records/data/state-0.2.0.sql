-- SPDX-License-Identifier: Apache-2.0
-- A database as the program of 0.2.0 wrote it, in a text: four accounts, a plan that one person made and
-- another approved, a comparison. The passwords are "correct horse NAME" (of phy2: ph2).
PRAGMA user_version = 9; PRAGMA foreign_keys = OFF;
BEGIN TRANSACTION;
CREATE TABLE audit (
  number INTEGER PRIMARY KEY AUTOINCREMENT,
  time INTEGER NOT NULL,
  user TEXT NOT NULL,
  address TEXT NOT NULL,
  action TEXT NOT NULL,
  subject TEXT NOT NULL,
  detail TEXT NOT NULL
, chain TEXT NOT NULL DEFAULT '') STRICT;
INSERT INTO "audit" VALUES(1,1796036055248417,'plumbd','','patient.add','1','','bd62ead3f425214bf843e21b5737e3a71e1cf3c194724b80d1fdb612ad6fa62f');
INSERT INTO "audit" VALUES(2,1796036055255696,'plumbd','','session.open','1','fraction','53823245dcbbf313f1d0ccaef4b58ce6b36deed318ed19a67b6a3db63fd5a4f0');
INSERT INTO "audit" VALUES(3,1796036055813579,'eng','127.0.0.1','user.add','eng','engineer','091ff40c43cc6999c41319a8ec666dd27139c908fcf908c37e1850a090eb279b');
INSERT INTO "audit" VALUES(4,1796036056075529,'eng','127.0.0.1','user.add','phy','physicist','87e9bf3865190c4c124527e56770b7b2732c7285ed23b6fb94ddebb406356391');
INSERT INTO "audit" VALUES(5,1796036056625210,'phy','127.0.0.1','login','','','ce7b796907df1f19d1f93c61fb773130c2414c106b585e7dd33f98ea6c55faec');
INSERT INTO "audit" VALUES(6,1796036057029425,'phy','127.0.0.1','user.change','phy','password','7e1e30e0c34d1d9b2eab49f7339626f059863190dcf6b8da0fd503b85977511e');
INSERT INTO "audit" VALUES(7,1796036057251487,'eng','127.0.0.1','user.add','phy2','physicist','91690c8018238df822c28889d88fe50d9d75c258d0be8117071697448a246bba');
INSERT INTO "audit" VALUES(8,1796036057523613,'phy2','127.0.0.1','login','','','d3d86fc6eca03772643e275ebfa3969b58ece937e1e607d8e8643444b6a3f433');
INSERT INTO "audit" VALUES(9,1796036058031588,'phy2','127.0.0.1','user.change','phy2','password','ae8c385cf39db66b25225ecf76dbe7896320648495440d12d005bff905192b4b');
INSERT INTO "audit" VALUES(10,1796036058317855,'eng','127.0.0.1','user.add','tec','technician','420ac73be4f97d67d7117ce0beba263dd33fb47c6ac1b1f7912c4da725bfa029');
INSERT INTO "audit" VALUES(11,1796036058567537,'tec','127.0.0.1','login','','','0a6f45b22bc3ca3bb73e87088a1a97bd588a9a76fd6430a49ca61f093f246c15');
INSERT INTO "audit" VALUES(12,1796036059133839,'tec','127.0.0.1','user.change','tec','password','285e27347271060d1d4ca3f0aad6e07e874ff1f372c60d82ea594750916c55fd');
INSERT INTO "audit" VALUES(13,1796036059136509,'eng','127.0.0.1','settings.change','','{"auto_stop_s":[10.0],"couch_markers":[false],"idle_logout_min":[15],"keep_recordings":[false],"posture":["HFS"],"retention_days":[0],"rotation_tolerance_deg":[1.0],"scan_limit_s":[60.0],"shift_tolerance_mm":[4.5]}','eef7f0728bd927b20bff4041de80e6662bf19119fe40b623122bf14ac5d1ce84');
INSERT INTO "audit" VALUES(14,1796036059137327,'phy','127.0.0.1','template.set','','Pelvis: region 300 x 200 mm, tolerance 5 mm and 3 degrees','6a50c4123cd0c56455b7062da761d9043f417b540b441ce8abc2e9742079ca58');
INSERT INTO "audit" VALUES(15,1796036059138432,'eng','127.0.0.1','display.pair','couch side','','0c0f18edad329ec7bef47dda79281f61b284e2fce260c18ca943474799192f18');
INSERT INTO "audit" VALUES(16,1796036059139876,'tec','127.0.0.1','session.close','1','','4752f6cf9286a3372841470a006f4776c6b86dd42dc6b7af064f6773769716f1');
INSERT INTO "audit" VALUES(17,1796036059140446,'tec','127.0.0.1','patient.add','2','','75615a09b7eb10a9bd07b5bd8385a8648aea921ccb36f9b358d9a6a2cb7ba688');
INSERT INTO "audit" VALUES(18,1796036059142595,'phy','127.0.0.1','session.open','2','reference','7f7d0f81259857b7b89155cd551f9028b18cde89be31e1934ac7e1666b272020');
INSERT INTO "audit" VALUES(19,1796036059144355,'control socket','','scan.start','2','reference','f3dd37b737c1d7ad8a01e0bcdb35b8cc1d0d406ff74c59d31c5fc20edd4b14bc');
INSERT INTO "audit" VALUES(20,1796036062400725,'control socket','','scan.end','2','reference','a0e1bfd1ab8088a47e01134859481d3af28bf32598c448bd9ba789c94a0a85c1');
INSERT INTO "audit" VALUES(21,1796036066579696,'phy','127.0.0.1','reference.add','1','scan 000001','3d9292ea5ffb0867f0f1c319d967c1a4cd68dcdd8b79d6ebe01e92c71fa16e4c');
INSERT INTO "audit" VALUES(22,1796036066951082,'phy','127.0.0.1','view.patient','2','','1142d627d9a4560e884d95e82d697ef958bba42c0f1069ed0acd3c662850111c');
INSERT INTO "audit" VALUES(23,1796036066951706,'phy','127.0.0.1','reference.plan','1','{"couch_markers":false,"posture":"HFS","region_m":[],"rotation_tolerance_deg":1.0,"shift_tolerance_mm":4.5}
{"couch_markers":false,"posture":"HFS","region_m":[],"rotation_tolerance_deg":2.5,"shift_tolerance_mm":5.5}','c3bb99a369b17e58e58db7d22aec5ffa74f061e1e38e3d27e8f7b811f1a4da0e');
INSERT INTO "audit" VALUES(24,1796036067469088,'phy2','127.0.0.1','reference.approve','1','sha256 64017020852a95ce1c4a9a379dcedb0be1df3fd322b53e28355a1115c3ce594e','045423399dca2e2004269e81d05b87b96062fab71e357f820e51019483f09d1e');
INSERT INTO "audit" VALUES(25,1796036067485333,'tec','127.0.0.1','session.close','2','','64c54319126dd625147fdf930dca63422a697e31746a66b29052d6205c161195');
INSERT INTO "audit" VALUES(26,1796036067487489,'tec','127.0.0.1','session.open','3','fraction','3dcba06dda3770999d626c8f0986c533bba2a6155b3670b82cd51e8b3245f764');
INSERT INTO "audit" VALUES(27,1796036068497695,'control socket','','scan.start','3','fraction','6de6cc91cc2f439e8c400897ac12cf0d0433f306950af9c2861d731141fc7603');
INSERT INTO "audit" VALUES(28,1796036071780730,'control socket','','scan.end','3','fraction','2398c503b5f388435f99f95712f5cb4f2794eca91c82be2fa9bf7c204746eb1b');
INSERT INTO "audit" VALUES(29,1796036079444785,'tec','127.0.0.1','view.scans','','','fb14aeec843f2e7d552d8bb368b600ae20dfe02cba5dc42297f4fbbcbc55fd20');
INSERT INTO "audit" VALUES(30,1796036079459307,'tec','127.0.0.1','session.close','3','','dd08e6eb58554ed979eb7d41087f0da512e91f26ef9e9ef3567f06bd4b021e2b');
CREATE TABLE check_baselines (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  check_id INTEGER NOT NULL REFERENCES checks(id),
  set_at INTEGER NOT NULL,
  set_by TEXT NOT NULL
) STRICT;
CREATE TABLE checks (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  time INTEGER NOT NULL,
  user TEXT NOT NULL,
  sensor_serial TEXT NOT NULL,
  status TEXT NOT NULL CHECK (status IN ('passed', 'failed', 'no_baseline')),
  json TEXT NOT NULL
) STRICT;
CREATE TABLE displays (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  name TEXT NOT NULL,
  token_hash TEXT NOT NULL UNIQUE,
  paired_at INTEGER NOT NULL,
  paired_by TEXT NOT NULL
) STRICT;
INSERT INTO "displays" VALUES(1,'couch side','e7ed3e87bfe88fcfa0fda8a593ddeb90b7981e9cc834b035fa091d12d369e960',1796036059138388,'eng');
CREATE TABLE patients (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  code TEXT NOT NULL UNIQUE,
  site TEXT NOT NULL,
  created_at INTEGER NOT NULL,
  wiping INTEGER NOT NULL DEFAULT 0
, note TEXT NOT NULL DEFAULT '', archived INTEGER NOT NULL DEFAULT 0) STRICT;
INSERT INTO "patients" VALUES(0,'(unassigned)','',0,0,'',0);
INSERT INTO "patients" VALUES(1,'demo','',1796036055248362,0,'',0);
INSERT INTO "patients" VALUES(2,'PX-1','pelvis',1796036059140432,0,'',0);
CREATE TABLE preferences (
  user TEXT PRIMARY KEY REFERENCES users(name) ON DELETE CASCADE,
  language TEXT NOT NULL,
  theme TEXT NOT NULL
) STRICT;
CREATE TABLE refs (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  patient_id INTEGER NOT NULL REFERENCES patients(id) ON DELETE CASCADE,
  version INTEGER NOT NULL,
  scan_id INTEGER NOT NULL REFERENCES scans(id),
  created_at INTEGER NOT NULL,
  created_by TEXT NOT NULL,
  planned_by TEXT NOT NULL,
  reason TEXT NOT NULL,
  plan TEXT NOT NULL,
  approved_by TEXT NOT NULL DEFAULT '',
  approved_at INTEGER,
  revision INTEGER NOT NULL DEFAULT 1,
  UNIQUE (patient_id, version)
) STRICT;
INSERT INTO "refs" VALUES(1,2,1,1,1796036066579589,'phy','phy','first','{"couch_markers":false,"posture":"HFS","region_m":[],"rotation_tolerance_deg":2.5,"shift_tolerance_mm":5.5}','phy2',1796036067469035,2);
CREATE TABLE removed_scans (id INTEGER PRIMARY KEY) STRICT;
CREATE TABLE results (
  scan_id INTEGER PRIMARY KEY REFERENCES scans(id) ON DELETE CASCADE,
  json TEXT NOT NULL
) STRICT;
INSERT INTO "results" VALUES(2,'{
 "format": 1,
 "version": "0.2.0",
 "preset": "best",
 "sensor_profiles": {
  "reference": null,
  "current": "VIRTUAL-0001 version 1, 1 sweep"
 },
 "verdict": "move",
 "reasons": [
  "outside 5.5 mm and 2.5 deg: longitudinal -38.9 mm (away from gantry), lateral -26.6 mm (to patient right), yaw -3.3 deg (head to patient left)"
 ],
 "limits": {
  "shift_tolerance_mm": 5.5,
  "rotation_tolerance_deg": 2.5,
  "min_shared_markers": 3,
  "moved_marker_mm": 5.0,
  "moved_marker_sigmas": 3.0,
  "min_coverage": 0.9,
  "max_hole_mm": 50.0,
  "max_residual_p95_mm": 25.0,
  "max_lost_s": 1.0,
  "max_breathing_mm": 8.0
 },
 "alignment": {
  "T_reference_current": [
   [
    0.9999998413554833,
    -0.00016859224402870215,
    -0.000537462244553877,
    -6.367060272716163e-05
   ],
   [
    0.00016753322164719114,
    0.9999980458117348,
    -0.001969849062941504,
    2.1121273197532986e-05
   ],
   [
    0.0005377932955253819,
    0.001969758707654407,
    0.9999979154123297,
    1.4437854525714035e-05
   ],
   [
    0.0,
    0.0,
    0.0,
    1.0
   ]
  ],
  "stretch": [
   [
    0.9997409132913672,
    -6.9204020574781255e-06,
    1.5379270924048213e-06
   ],
   [
    -6.9204020574781255e-06,
    1.0000341764256737,
    -1.6616768320750017e-08
   ],
   [
    1.537927092403954e-06,
    -1.6616768320912648e-08,
    0.9999999909678109
   ]
  ],
  "rms_m": 0.00041869579004054033,
  "markers_used": [
   4,
   5,
   6,
   14,
   37,
   52,
   65,
   73,
   90,
   94,
   99,
   100,
   116,
   131,
   144,
   159,
   160,
   178,
   180,
   187,
   203,
   224,
   231,
   232
  ],
  "markers_rejected": {},
  "covariance": [
   [
    6.815355227443835e-09,
    1.4442908285763119e-10,
    -2.4457231580507954e-11,
    3.267849212597335e-27,
    -1.9218346234140328e-27,
    8.992834830512304e-25
   ],
   [
    1.4442908285763116e-10,
    4.489389918102894e-09,
    -3.8470663236614776e-12,
    1.642140923643671e-27,
    -6.802009046430947e-29,
    -1.7726702660320406e-26
   ],
   [
    -2.4457231580507954e-11,
    -3.847066323661478e-12,
    2.705118986632419e-09,
    -3.5741039952457743e-25,
    2.2185840069383878e-26,
    -3.199829122133026e-27
   ],
   [
    3.267849212597335e-27,
    1.642140923643671e-27,
    -3.574103995245774e-25,
    8.38605737308026e-10,
    -2.9312850628831754e-42,
    4.1829508820466996e-43
   ],
   [
    -1.9218346234140324e-27,
    -6.802009046430947e-29,
    2.2185840069383878e-26,
    -2.9312850628831754e-42,
    8.38605737308026e-10,
    -2.533615541375492e-43
   ],
   [
    8.992834830512304e-25,
    -1.7726702660320403e-26,
    -3.199829122133026e-27,
    4.1829508820466996e-43,
    -2.533615541375492e-43,
    8.38605737308026e-10
   ]
  ],
  "centre_m": [
   0.5065287314374075,
   0.4037325494029716,
   -0.0012107759418275397
  ]
 },
 "motion": {
  "T": [
   [
    0.9982176576984487,
    -0.058152841186450706,
    0.013407271197588484,
    -0.014562569395856055
   ],
   [
    0.05811829212779589,
    0.9983053371993109,
    0.0029525987735838114,
    -0.005387139739144021
   ],
   [
    -0.013556252401398735,
    -0.0021681285277921594,
    0.999905759179092,
    0.010992643077953721
   ],
   [
    0.0,
    0.0,
    0.0,
    1.0
   ]
  ],
  "covariance": [
   [
    7.869339131990438e-07,
    6.088781182772847e-08,
    3.482241622139327e-08,
    -9.108841032339196e-09,
    -4.782658814220428e-08,
    3.973085463607325e-09
   ],
   [
    6.088781182772805e-08,
    2.3524232842024365e-07,
    -9.33128970517967e-09,
    1.5340204459824798e-08,
    1.791642238253403e-08,
    -9.401016272028005e-09
   ],
   [
    3.482241622139351e-08,
    -9.331289705179624e-09,
    3.50120531994534e-07,
    -2.7263777027001648e-09,
    -5.298388982786007e-09,
    3.1567963393161625e-08
   ],
   [
    -9.108841032339569e-09,
    1.5340204459824934e-08,
    -2.7263777027000333e-09,
    1.2412474972233577e-07,
    -8.991220489254403e-09,
    4.467412691744496e-09
   ],
   [
    -4.7826588142204374e-08,
    1.791642238253419e-08,
    -5.298388982786088e-09,
    -8.991220489254191e-09,
    1.060254266791407e-07,
    2.048764108955837e-08
   ],
   [
    3.973085463608986e-09,
    -9.401016272027236e-09,
    3.156796339316123e-08,
    4.4674126917443376e-09,
    2.0487641089558407e-08,
    2.356435321431023e-07
   ]
  ],
  "covariance_parts": {
   "surface": [
    [
     2.257811347810652e-07,
     1.6374248765249267e-08,
     3.045201253548068e-08,
     1.0741994148356827e-09,
     -3.7136706528699135e-08,
     -3.61883786895267e-10
    ],
    [
     1.6374248765249257e-08,
     2.3275773417568883e-08,
     6.722967144435103e-09,
     6.9564859145938174e-09,
     3.716044956613068e-10,
     2.021780771213459e-10
    ],
    [
     3.045201253548068e-08,
     6.722967144435104e-09,
     1.231817047666831e-07,
     2.6026791877498167e-09,
     -6.9189797588610176e-09,
     -2.724014402492815e-09
    ],
    [
     1.0741994148356812e-09,
     6.956485914593822e-09,
     2.602679187749816e-09,
     1.614415332483736e-08,
     4.246859725262945e-10,
     4.622307864567146e-10
    ],
    [
     -3.713670652869912e-08,
     3.716044956613066e-10,
     -6.918979758861019e-09,
     4.2468597252629453e-10,
     1.1945347892556985e-08,
     -6.952169663064565e-11
    ],
    [
     -3.618837868952673e-10,
     2.0217807712134612e-10,
     -2.724014402492815e-09,
     4.6223078645671464e-10,
     -6.952169663064566e-11,
     1.0293859953045352e-09
    ]
   ],
   "markers": [
    [
     6.815355227443835e-09,
     1.4442908285763119e-10,
     -2.4457231580507954e-11,
     2.7980488558443255e-11,
     -1.2167366328021644e-09,
     6.118768168448964e-10
    ],
    [
     1.4442908285763116e-10,
     4.489389918102894e-09,
     -3.8470663236614776e-12,
     8.023213557948914e-10,
     -2.568278326901756e-11,
     1.5037674142504304e-10
    ],
    [
     -2.4457231580507954e-11,
     -3.847066323661478e-12,
     2.705118986632419e-09,
     -2.4179470570201895e-10,
     -7.848502375928813e-11,
     -2.2977052894256906e-12
    ],
    [
     2.798048855844325e-11,
     8.023213557948914e-10,
     -2.4179470570201895e-10,
     1.003482506882528e-09,
     2.4074391987625596e-12,
     2.7067889793431207e-11
    ],
    [
     -1.2167366328021644e-09,
     -2.5682783269017562e-11,
     -7.848502375928813e-11,
     2.4074391987625592e-12,
     1.0583657900519471e-09,
     -1.0923446104166729e-10
    ],
    [
     6.118768168448964e-10,
     1.5037674142504304e-10,
     -2.2977052894256906e-12,
     2.706788979343121e-11,
     -1.092344610416673e-10,
     8.977481971229548e-10
    ]
   ],
   "distortion": [
    [
     1.2208611490858155e-07,
     0.0,
     0.0,
     0.0,
     0.0,
     0.0
    ],
    [
     0.0,
     1.2208611490858155e-07,
     0.0,
     0.0,
     0.0,
     0.0
    ],
    [
     0.0,
     0.0,
     1.2208611490858155e-07,
     0.0,
     0.0,
     0.0
    ],
    [
     0.0,
     0.0,
     0.0,
     4.01700002077947e-08,
     -8.509804223995999e-09,
     1.0293760196192076e-08
    ],
    [
     0.0,
     0.0,
     0.0,
     -8.509804223995999e-09,
     3.071509984990854e-08,
     -7.109811607242135e-09
    ],
    [
     0.0,
     0.0,
     0.0,
     1.0293760196192076e-08,
     -7.109811607242135e-09,
     9.227538510565287e-08
    ]
   ],
   "scale": [
    [
     0.0,
     0.0,
     0.0,
     0.0,
     0.0,
     0.0
    ],
    [
     0.0,
     0.0,
     0.0,
     0.0,
     0.0,
     0.0
    ],
    [
     0.0,
     0.0,
     0.0,
     0.0,
     0.0,
     0.0
    ],
    [
     0.0,
     0.0,
     0.0,
     1.6617990098218986e-09,
     -1.0717764670751388e-09,
     -2.973854013078889e-10
    ],
    [
     0.0,
     0.0,
     0.0,
     -1.0717764670751388e-09,
     8.5054588529254e-10,
     5.894093658889985e-10
    ],
    [
     0.0,
     0.0,
     0.0,
     -2.973854013078889e-10,
     5.894093658889985e-10,
     1.0456238281006836e-09
    ]
   ],
   "frame": [
    [
     1.023975313766338e-09,
     -1.2528737902648642e-12,
     4.5387707909287477e-11,
     1.6983585263425479e-10,
     -1.5275713186393869e-10,
     7.637851646275091e-10
    ],
    [
     -1.2528737902648642e-12,
     1.0215066791257067e-09,
     -2.369447539458736e-10,
     2.935928951673047e-10,
     7.732333375429025e-11,
     -3.9957827505934995e-10
    ],
    [
     4.5387707909287464e-11,
     -2.369447539458736e-10,
     5.694692526835853e-11,
     -6.060503298748233e-11,
     -2.4659062557709232e-11,
     1.2630111512209863e-10
    ],
    [
     1.6983585263425479e-10,
     2.9359289516730466e-10,
     -6.060503298748233e-11,
     2.1003409688721406e-10,
     -2.969695577675393e-12,
     1.6270847197128394e-11
    ],
    [
     -1.5275713186393866e-10,
     7.732333375429025e-11,
     -2.4659062557709232e-11,
     -2.9696955776753913e-12,
     1.221262471872254e-10,
     -1.6572235596663729e-10
    ],
    [
     7.63785164627509e-10,
     -3.995782750593499e-10,
     1.2630111512209865e-10,
     1.627084719712837e-11,
     -1.657223559666373e-10,
     7.304942482247627e-10
    ]
   ],
   "sensor": [
    [
     4.3122733296818686e-07,
     4.437038685341184e-08,
     4.349473209583807e-09,
     -1.0380856788367577e-08,
     -9.320387848839041e-09,
     2.9593072690301864e-09
    ],
    [
     4.437038685341141e-08,
     8.43695434968646e-08,
     -1.5813465029345238e-08,
     7.287804294268784e-09,
     1.7493177336387452e-08,
     -9.353992815515045e-09
    ],
    [
     4.349473209584047e-09,
     -1.5813465029345192e-08,
     1.0209064640736861e-07,
     -5.02665715176048e-09,
     1.7237348623920077e-09,
     3.4167974385821764e-08
    ],
    [
     -1.0380856788367947e-08,
     7.2878042942689165e-09,
     -5.026657151760348e-09,
     6.493528057611208e-08,
     1.6623648566935454e-10,
     -6.034531626586965e-09
    ],
    [
     -9.320387848839147e-09,
     1.749317733638761e-08,
     1.7237348623919283e-09,
     1.662364856695663e-10,
     6.133394101414347e-08,
     2.735252184455046e-08
    ],
    [
     2.9593072690318474e-09,
     -9.353992815514275e-09,
     3.416797438582137e-08,
     -6.034531626587124e-09,
     2.7352521844550495e-08,
     1.3966489476869652e-07
    ]
   ],
   "breathing": [
    [
     0.0,
     0.0,
     0.0,
     0.0,
     0.0,
     0.0
    ],
    [
     0.0,
     0.0,
     0.0,
     0.0,
     0.0,
     0.0
    ],
    [
     0.0,
     0.0,
     0.0,
     0.0,
     0.0,
     0.0
    ],
    [
     0.0,
     0.0,
     0.0,
     0.0,
     0.0,
     0.0
    ],
    [
     0.0,
     0.0,
     0.0,
     0.0,
     0.0,
     0.0
    ],
    [
     0.0,
     0.0,
     0.0,
     0.0,
     0.0,
     0.0
    ]
   ]
  },
  "weak_directions": [],
  "residual_m": {
   "median": 0.0004410197725519538,
   "p95": 0.0013567677233368158
  },
  "centroid_m": [
   0.516289707917928,
   0.468522751563817,
   0.17446642441242735
  ],
  "inlier_share": 0.9638698356994736
 },
 "correction": {
  "isocentre": [
   0.516289707917928,
   0.468522751563817,
   0.17446642441242735
  ],
  "vertical_mm": -2.4915027696499057,
  "longitudinal_mm": -38.94315059034115,
  "lateral_mm": -26.640978069477182,
  "pitch_deg": -0.7682030702950873,
  "roll_deg": -0.16918690094100886,
  "yaw_deg": -3.334093192986941,
  "uncertainty": {
   "vertical_mm": 0.9550048633467894,
   "longitudinal_mm": 0.6870062709135363,
   "lateral_mm": 0.6408478757548749,
   "pitch_deg": 0.05447286892239981,
   "roll_deg": 0.09956302394757513,
   "yaw_deg": 0.06644828113231012
  },
  "words": {
   "vertical": "down",
   "longitudinal": "away from gantry",
   "lateral": "to patient right",
   "pitch": "head down",
   "roll": "patient right side down",
   "yaw": "head to patient left"
  }
 },
 "region": {
  "coverage": 0.9931228426751704,
  "largest_hole_m": 0.01697056245803833,
  "hole_centre_m": [
   0.402,
   0.324
  ],
  "min_coverage": 0.9,
  "max_hole_m": 0.05
 },
 "body": {
  "named_by": "posture",
  "room_known": true,
  "parts": [
   {
    "name": "head and neck",
    "centre_m": [
     0.16565748425872748,
     0.46173812249570806,
     0.1610919240964486
    ],
    "now_mm": 7.7095444328293405,
    "after_mm": -0.02111494541168213,
    "words_now": "head and neck 8 mm high",
    "words_after": null,
    "largest_shift_mm": [
     0.12662034014283563,
     0.5354007545975037,
     -0.02154488292944734
    ],
    "words_shift": null
   },
   {
    "name": "left shoulder",
    "centre_m": [
     0.2650402018863551,
     0.5661407942941556,
     0.18088473233608698
    ],
    "now_mm": 6.221652552229228,
    "after_mm": 0.0664740800857544,
    "words_now": "left shoulder 6 mm high",
    "words_after": null,
    "largest_shift_mm": [
     0.14173795061651617,
     0.5315375892678276,
     0.5011653469409794
    ],
    "words_shift": null
   },
   {
    "name": "right shoulder",
    "centre_m": [
     0.27341871038854,
     0.3504135781206914,
     0.1751521959783831
    ],
    "now_mm": 6.4576929013400175,
    "after_mm": -0.052168965339660645,
    "words_now": "right shoulder 6 mm high",
    "words_after": null,
    "largest_shift_mm": [
     -0.062137119960465025,
     0.3412085504311582,
     -0.12577823358499343
    ],
    "words_shift": null
   },
   {
    "name": "left chest",
    "centre_m": [
     0.43167178842111786,
     0.5590911566141933,
     0.1729366159711087
    ],
    "now_mm": 3.803086673057232,
    "after_mm": -0.10922551155090332,
    "words_now": "left chest 4 mm high",
    "words_after": null,
    "largest_shift_mm": [
     0.5829934343637433,
     0.8205785707104951,
     0.5035712856624741
    ],
    "words_shift": null
   },
   {
    "name": "right chest",
    "centre_m": [
     0.4371723388098897,
     0.38531330249896334,
     0.17887330357919867
    ],
    "now_mm": 4.284187752590013,
    "after_mm": 0.070229172706604,
    "words_now": "right chest 4 mm high",
    "words_after": null,
    "largest_shift_mm": [
     0.12830805817862884,
     -0.23511438727534065,
     0.33921766416391447
    ],
    "words_shift": null
   },
   {
    "name": "left side of the abdomen",
    "centre_m": [
     0.6667981732469023,
     0.5429943650559359,
     0.18151808234121547
    ],
    "now_mm": 0.6760457921856922,
    "after_mm": -0.08292496204376221,
    "words_now": null,
    "words_after": null,
    "largest_shift_mm": [
     0.08287570762193008,
     -0.13386095330740014,
     -0.3033836391772465
    ],
    "words_shift": null
   },
   {
    "name": "right side of the abdomen",
    "centre_m": [
     0.6716508318739012,
     0.3997182574430822,
     0.18116334622037547
    ],
    "now_mm": 1.1954306642618373,
    "after_mm": 0.19156932830810547,
    "words_now": null,
    "words_after": null,
    "largest_shift_mm": [
     0.05691356527677271,
     -0.3369134254171513,
     0.4263101742253639
    ],
    "words_shift": null
   },
   {
    "name": "left side of the pelvis",
    "centre_m": [
     0.8465773526509399,
     0.558573315690301,
     0.16277976336033342
    ],
    "now_mm": -1.71862138942519,
    "after_mm": -0.008448958396911621,
    "words_now": null,
    "words_after": null,
    "largest_shift_mm": [
     -0.37790185306221247,
     0.13582440224126913,
     -0.36179333837935695
    ],
    "words_shift": null
   },
   {
    "name": "right side of the pelvis",
    "centre_m": [
     0.8573563487811446,
     0.39896082239485553,
     0.16590410927550922
    ],
    "now_mm": -1.6165659270764021,
    "after_mm": -0.10603666305541992,
    "words_now": null,
    "words_after": null,
    "largest_shift_mm": [
     -0.2696238822863961,
     0.2464261255227029,
     -0.4556199972284958
    ],
    "words_shift": null
   }
  ],
  "head_xy": [
   -0.9995013513754513,
   -0.03157607636560842
  ],
  "left_xy": [
   -0.03157607636560842,
   0.9995013513754513
  ],
  "gantry_xy": [
   -1.0,
   0.0
  ],
  "right_xy": [
   0.0,
   1.0
  ]
 },
 "deformation": {
  "samples": 3964,
  "observed": 3541,
  "shift_mm": {
   "median": 0.251842831370136,
   "p95": 0.5880684472647519
  },
  "residual_mm": {
   "median": 0.35748105796090657,
   "p95": 1.1603769323798574
  }
 },
 "warnings": [],
 "timings_s": {
  "alignment": 0.00042951799969159765,
  "deformation": 0.8258501489999617,
  "deviation": 0.7959901599997465,
  "deviation_after": 0.3855604880000101,
  "motion": 0.5997845249994498,
  "region": 0.2881026799996107,
  "total": 2.1465074689995163,
  "trust": 0.04671634499936772
 }
}
');
CREATE TABLE room_calibrations (
  version INTEGER PRIMARY KEY AUTOINCREMENT,
  signed_at INTEGER NOT NULL,
  signed_by TEXT NOT NULL,
  digest TEXT NOT NULL,
  json TEXT NOT NULL
) STRICT;
CREATE TABLE scan_files (
  scan_id INTEGER NOT NULL REFERENCES scans(id) ON DELETE CASCADE,
  path TEXT NOT NULL,
  bytes INTEGER NOT NULL,
  sha256 TEXT NOT NULL,
  PRIMARY KEY (scan_id, path)
) STRICT, WITHOUT ROWID;
INSERT INTO "scan_files" VALUES(1,'scene/cloud.ply',5245893,'0362e3e682c5aaad4e90cb3ea7156521113a0fead09c119efa24eb3841204b09');
INSERT INTO "scan_files" VALUES(1,'scene/heightmap.tiff',4864530,'d931f7de7a7f34eac89467b5c11cd2a6831f37c1d1272192c3290bea16e32e39');
INSERT INTO "scan_files" VALUES(1,'scene/mesh.ply',10939617,'11443fd6bade589eed84dd0842746caaacd28ab31804637371b4edba477d9b86');
INSERT INTO "scan_files" VALUES(1,'scene/scene.json',17873,'e2421d320a26c5e035ae285c69d991057caab71950ca12d9421c3adf5b95dc57');
INSERT INTO "scan_files" VALUES(1,'scene/sensitivity.json',153117,'1f5a3549bcf1097e5c4ffcd5d959846e4f8192b09f1d1280e966b6629d65a78d');
INSERT INTO "scan_files" VALUES(1,'scene/trajectory.txt',1931,'b3ded2873ef6f46e343011185421d971e0badcf38b544c8c25f91ea2abfe3fc0');
INSERT INTO "scan_files" VALUES(1,'scene/trajectory_all.txt',6889,'f4cae1e2d9795e07d224b9b871d0fb130d4b3a5d7201219e30c294982cafb412');
INSERT INTO "scan_files" VALUES(2,'result/deformation.ply',99348,'4a3825312b714e5e1406542b804c15803c3aa4070e3d5145ba2ef550f58a3b29');
INSERT INTO "scan_files" VALUES(2,'result/deviation.tiff',4864530,'5e3bf6c9a5791d1823f2d515ac0424f711150865337fd3ddb015843d99f194a2');
INSERT INTO "scan_files" VALUES(2,'result/deviation_after.tiff',4864530,'88a144a0f3a9e86338eb7e3ad845811d20c1c72afbff769deb8bd465814f7886');
INSERT INTO "scan_files" VALUES(2,'result/distance.tiff',4864530,'a952e32d3e01a28343b6d911ab8c6fb46651773a22cbc303e602cbfe9e5be9f8');
INSERT INTO "scan_files" VALUES(2,'result/error_map.png',1011524,'6cb1d3cad124cfd5a703d820e69b174cad09d097c990b3f7a0ab264ddce3b5ca');
INSERT INTO "scan_files" VALUES(2,'result/overlay.png',1455362,'20d465801385f4dac33caded3471c0bf799c91888ad5f26544e69f41dccf769f');
INSERT INTO "scan_files" VALUES(2,'result/region.png',11543,'3c5461da87f240ef903cd4958fe94540300e7784af30d79dc347ecc0a79e7614');
INSERT INTO "scan_files" VALUES(2,'result/result.json',16317,'969de5d1c3e8ac1a35a0904db9d39a0ac6830903c6ce2f2504379b06e7e72bf9');
INSERT INTO "scan_files" VALUES(2,'scene/cloud.ply',5521845,'149d75d7f769ff124cdd3aadf7d83c87d5c84b4c2027035b4bec6bf96723b988');
INSERT INTO "scan_files" VALUES(2,'scene/heightmap.tiff',5097154,'b5869e9e888dd3057a6c7324c505bac7065d853ec217bfaa038f1401569cf7e0');
INSERT INTO "scan_files" VALUES(2,'scene/mesh.ply',11585073,'dc87804880af0b7dde60f9280d66a2e7a3ed9c28ac0eaeac186752cce1d4ca6b');
INSERT INTO "scan_files" VALUES(2,'scene/scene.json',18328,'3f580e0dedeee9313de5de17e1255ad6a0bd96a1bb73b5bb4b426637230880fa');
INSERT INTO "scan_files" VALUES(2,'scene/sensitivity.json',166027,'ac81b76e9d9d2c7142fbd271ca22445dab277a47313c2c8ea760dfeadbd631db');
INSERT INTO "scan_files" VALUES(2,'scene/trajectory.txt',2142,'5132f4f41500a306740543b6ce9eb9f825ad84f673dcc2a987652a8e95a94118');
INSERT INTO "scan_files" VALUES(2,'scene/trajectory_all.txt',9150,'e5e2a3aebd4c83e5cda50b4ab129f070d7f5878c1ee717ab68a46840e442db8d');
CREATE TABLE scans (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  patient_id INTEGER NOT NULL REFERENCES patients(id) ON DELETE CASCADE,
  reference_id INTEGER REFERENCES refs(id) ON DELETE SET NULL,
  purpose TEXT NOT NULL CHECK (purpose IN ('fraction', 'reference', 'daily_check')),
  outcome TEXT NOT NULL CHECK (outcome IN ('running', 'done', 'cancelled', 'failed')),
  failure TEXT NOT NULL DEFAULT '',
  started_at INTEGER NOT NULL,
  finished_at INTEGER,
  sensor_serial TEXT NOT NULL,
  swept_area_m2 REAL NOT NULL DEFAULT 0,
  reason TEXT NOT NULL DEFAULT '',
  accepted_by TEXT NOT NULL DEFAULT '',
  has_folder INTEGER NOT NULL DEFAULT 0
, session_id INTEGER REFERENCES sessions(id) ON DELETE SET NULL, accepted_reason TEXT NOT NULL DEFAULT '', sensor_on_s REAL, check_overdue INTEGER NOT NULL DEFAULT 0, unavailable TEXT NOT NULL DEFAULT '', checked_at INTEGER NOT NULL DEFAULT 0, accepted_at INTEGER) STRICT;
INSERT INTO "scans" VALUES(1,2,NULL,'reference','done','',1796036059143533,1796036066567401,'VIRTUAL-0001',2.8925,'first','',1,2,'',3.871846986,1,'',0,NULL);
INSERT INTO "scans" VALUES(2,2,1,'fraction','done','',1796036068496855,1796036079068001,'VIRTUAL-0001',3.01000000000000023092e+00,'','',1,3,'',13.224816224,1,'',0,NULL);
CREATE TABLE sessions (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  patient_id INTEGER NOT NULL REFERENCES patients(id) ON DELETE CASCADE,
  purpose TEXT NOT NULL CHECK (purpose IN ('fraction', 'reference')),
  fraction INTEGER NOT NULL DEFAULT 0,
  opened_at INTEGER NOT NULL,
  opened_by TEXT NOT NULL,
  closed_at INTEGER,
  closed_by TEXT NOT NULL DEFAULT ''
) STRICT;
INSERT INTO "sessions" VALUES(1,1,'fraction',1,1796036055255658,'plumbd',1796036059139841,'tec');
INSERT INTO "sessions" VALUES(2,2,'reference',0,1796036059142579,'phy',1796036067485319,'tec');
INSERT INTO "sessions" VALUES(3,2,'fraction',1,1796036067487471,'tec',1796036079459286,'tec');
CREATE TABLE settings (name TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT;
INSERT INTO "settings" VALUES('usable_from_schema','9');
INSERT INTO "settings" VALUES('settings','{"auto_stop_s":10.0,"couch_markers":false,"idle_logout_min":15,"keep_recordings":false,"posture":"HFS","retention_days":0,"rotation_tolerance_deg":1.0,"scan_limit_s":60.0,"shift_tolerance_mm":4.5}');
CREATE TABLE templates (
  site TEXT PRIMARY KEY COLLATE NOCASE,
  width_mm REAL NOT NULL,
  height_mm REAL NOT NULL,
  shift_mm REAL NOT NULL,
  rotation_deg REAL NOT NULL,
  changed_by TEXT NOT NULL
) STRICT;
INSERT INTO "templates" VALUES('Pelvis',300.0,200.0,5.0,3.0,'phy');
CREATE TABLE users (
  name TEXT PRIMARY KEY,
  role TEXT NOT NULL CHECK (role IN ('technician', 'physicist', 'engineer')),
  password_hash TEXT NOT NULL,
  disabled INTEGER NOT NULL DEFAULT 0,
  created_at INTEGER NOT NULL
) STRICT;
INSERT INTO "users" VALUES('eng','engineer','$argon2id$v=19$m=65536,t=3,p=1$Bvxp1NCSaGkGdNTyL+UYVg$vNbthEE54fND6R9wpDraWwwEkKBTGPFZVd3dtbYBhrc',0,1796036055813500);
INSERT INTO "users" VALUES('phy','physicist','$argon2id$v=19$m=65536,t=3,p=1$+FdRDnUm6dCd8CnmcBR+jA$ODmfpABY8Wb6TQ/QBC4goHn8M8gT6VJa3PplCfEj8fg',0,1796036056075478);
INSERT INTO "users" VALUES('phy2','physicist','$argon2id$v=19$m=65536,t=3,p=1$J/ho48xpc8DGCn+SZyy+tg$SYAVTrQ2LSKjGbQNE5QdX3p2+wJWT6snm/vKSg9olkQ',0,1796036057251431);
INSERT INTO "users" VALUES('tec','technician','$argon2id$v=19$m=65536,t=3,p=1$f1OUioalvCpqwY1rS3MqSQ$1Gd/BRYsOrJQzL0C5DuvmrTP0/K9pG+qyJZwkioUxMU',0,1796036058317792);
CREATE INDEX scans_of_patient ON scans(patient_id, id);
CREATE TRIGGER refs_immutable BEFORE UPDATE ON refs WHEN OLD.approved_by <> ''
  BEGIN SELECT RAISE(ABORT, 'an approved reference is never changed'); END;
CREATE TRIGGER refs_stay BEFORE DELETE ON refs
  WHEN OLD.approved_by <> '' AND EXISTS (SELECT 1 FROM patients WHERE id = OLD.patient_id AND wiping = 0)
  BEGIN SELECT RAISE(ABORT, 'an approved reference goes only with its patient'); END;
CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit BEGIN SELECT RAISE(ABORT, 'the audit log is append-only'); END;
CREATE TRIGGER audit_no_delete BEFORE DELETE ON audit BEGIN SELECT RAISE(ABORT, 'the audit log is append-only'); END;
CREATE INDEX checks_by_time ON checks(status, time);
CREATE TRIGGER checks_no_update BEFORE UPDATE ON checks BEGIN SELECT RAISE(ABORT, 'checks are append-only'); END;
CREATE TRIGGER checks_no_delete BEFORE DELETE ON checks BEGIN SELECT RAISE(ABORT, 'checks are append-only'); END;
CREATE INDEX sessions_of_patient ON sessions(patient_id, id);
CREATE INDEX scans_of_session ON scans(session_id);
CREATE TRIGGER scan_files_no_update BEFORE UPDATE ON scan_files
  BEGIN SELECT RAISE(ABORT, 'the digest of a stored file is never changed'); END;
CREATE TRIGGER room_calibrations_no_update BEFORE UPDATE ON room_calibrations
  BEGIN SELECT RAISE(ABORT, 'a signed calibration of the room is never changed'); END;
CREATE TRIGGER room_calibrations_no_delete BEFORE DELETE ON room_calibrations
  BEGIN SELECT RAISE(ABORT, 'a signed calibration of the room is never removed'); END;
DELETE FROM "sqlite_sequence";
INSERT INTO "sqlite_sequence" VALUES('patients',2);
INSERT INTO "sqlite_sequence" VALUES('audit',30);
INSERT INTO "sqlite_sequence" VALUES('sessions',3);
INSERT INTO "sqlite_sequence" VALUES('displays',1);
INSERT INTO "sqlite_sequence" VALUES('scans',2);
INSERT INTO "sqlite_sequence" VALUES('refs',1);
COMMIT;
PRAGMA foreign_keys = ON;
