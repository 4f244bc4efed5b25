// The appliance's refusals, reports of its own faults, and entries of its log, in Spanish.
// es_appliance.js includes them.
export const kFaultWords = {
  'the stored settings': 'los ajustes guardados', 'a stored plan': 'un plan guardado',
  // Refusals of scan and session.
  'no scan is running': 'no hay ningún escaneo en curso',
  'no scan is running: press shortly to start one':
    'no hay ningún escaneo en curso: pulse brevemente para empezar uno',
  'the scan is being discarded: wait a moment': 'se está descartando el escaneo: espere un momento',
  'the last scan is being worked on: wait for its result':
    'se está calculando el último escaneo: espere su resultado',
  'the last scan failed: press the button to acknowledge it':
    'el último escaneo falló: pulse el botón para darse por enterado',
  'the storage has failed: see the reason in the status; nothing can be scanned':
    'ha fallado el almacenamiento: vea el motivo en el estado; no se puede escanear',
  'the sensor does not work: see the reason in the status; unplug it and plug it in again':
    'el sensor no funciona: vea el motivo en el estado; desconéctelo y vuelva a conectarlo',
  'no sensor is attached: plug it in and wait for the ready light':
    'no hay ningún sensor conectado: conéctelo y espere la luz de listo',
  'the appliance is being switched off': 'el equipo se está apagando',
  'nothing can be stored': 'no se puede guardar nada',
  'a patient is being opened: press again in a moment':
    'se está abriendo un paciente: pulse de nuevo en un momento',
  'a patient is being opened: try again in a moment':
    'se está abriendo un paciente: inténtelo de nuevo en un momento',
  'this patient\'s data is being removed: press again in a moment':
    'se están borrando los datos de este paciente: pulse de nuevo en un momento',
  'this patient\'s data is being removed: try again in a moment':
    'se están borrando los datos de este paciente: inténtelo de nuevo en un momento',
  'this scan belongs to no patient: open the patient, then scan a reference':
    'este escaneo no es de ningún paciente: abra el paciente y escanee una referencia',
  ['a newer version of this reference is approved, and scans are compared with the newest: change '
    + 'the plan of that one']:
    'hay aprobada una versión más nueva de esta referencia, y los escaneos se comparan con la más '
    + 'nueva: cambie el plan de esa',
  'another version of the reference has been approved since this scan: scan again, then accept':
    'desde este escaneo se ha aprobado otra versión de la referencia: escanee de nuevo y acepte '
    + 'después',
  'the session of a patient is open: close it first, then install the update':
    'la sesión de un paciente está abierta: ciérrela primero e instale después la actualización',
  'a scan of this patient is running: end or cancel it first':
    'hay un escaneo de este paciente en curso: termínelo o descártelo primero',
  'this session is closed already, or another one is open by now':
    'esta sesión ya está cerrada, o ya hay otra abierta',
  'a scan is running: accept its result, not an older one':
    'hay un escaneo en curso: acepte su resultado, no uno anterior',
  'this scan has no result: only a compared scan is accepted':
    'este escaneo no tiene resultado: solo se acepta un escaneo comparado',
  'this scan gave no answer: there is nothing to accept':
    'este escaneo no dio respuesta: no hay nada que aceptar',
  'there is a newer scan of this patient: accept that one':
    'hay un escaneo más nuevo de este paciente: acepte ese',
  'this result is not in tolerance: accepting it requires a reason and your password':
    'este resultado no está en tolerancia: aceptarlo requiere un motivo y su contraseña',
  'a scan is removed for a reason: state it': 'un escaneo se borra por un motivo: indíquelo',
  'this scan is running: discard it instead': 'este escaneo está en curso: descártelo',
  // The page's certificate, and how browsers are known again.
  ['the page is served without TLS (web.plain_http): passwords and patient data can be read and '
    + 'changed on the network']:
    'la página se sirve sin TLS (web.plain_http): las contraseñas y los datos de los pacientes se '
    + 'pueden leer y cambiar en la red',
  ['the certificate cannot be replaced here: the page is served without TLS, or the configuration '
    + 'names the certificate (web.tls_certificate)']:
    'el certificado no se puede cambiar aquí: la página se sirve sin TLS o la configuración nombra '
    + 'el certificado (web.tls_certificate)',
  'what was handed in': 'lo entregado',
  'holds no certificate that can be read': 'no contiene ningún certificado legible',
  'holds no key that can be read without a password':
    'no contiene ninguna clave que se pueda leer sin contraseña',
  'holds a certificate of an unknown kind': 'contiene un certificado de un tipo desconocido',
  'holds a key of an unknown kind': 'contiene una clave de un tipo desconocido',
  'expected a file of the appliance\'s own': 'se esperaba un archivo propio del equipo',
  // References and plans.
  'this scan has no scene: only a finished scan can become a reference':
    'este escaneo no tiene escena: solo un escaneo terminado puede ser referencia',
  ['this scan cannot become a reference: the reference marker was not seen; keep it in view during '
    + 'a part of the sweep']:
    'este escaneo no puede ser referencia: no se vio el marcador de referencia; manténgalo a la '
    + 'vista durante parte del barrido',
  'this plan has been changed by somebody else meanwhile: look at it again':
    'otra persona ha cambiado este plan entretanto: mírelo de nuevo',
  'there is no such reference': 'no existe esa referencia',
  'nobody has planned this reference: save its plan first':
    'nadie ha planificado esta referencia: guarde antes su plan',
  'this reference is approved already': 'esta referencia ya está aprobada',
  'what is stored is not what was shown: look at the reference again':
    'lo guardado no es lo que se mostró: mire la referencia de nuevo',
  'who made or planned a reference does not approve it: ask a second person':
    'quien escaneó o planificó una referencia no la aprueba: pídaselo a otra persona',
  // The daily check.
  'there is no such check': 'no existe ese control',
  'this check saw fewer than 3 markers well: check again and sweep over all of them':
    'este control vio bien menos de 3 marcadores: repítalo y bárralos todos',
  'somebody other than the person who took this check must set it as the baseline':
    'lo fija como base otra persona que la que hizo este control',
  'the stored baseline of the daily check cannot be read: set another one':
    'no se puede leer la base guardada del control diario: fije otra',
  // Patients, accounts, screens.
  'there is a patient with this code already: choose another code':
    'ya hay un paciente con este código: elija otro',
  'code must be letters, digits, \'.\', \'-\' or \'_\': a pseudonym, no name':
    'el código solo admite letras, cifras, «.», «-» o «_»: un seudónimo, sin nombre',
  'there is an account of this name already: choose another name':
    'ya hay una cuenta con este nombre: elija otro',
  'there is no such account': 'no existe esa cuenta',
  'this patient was changed by somebody else meanwhile: look again, then save':
    'otra persona ha cambiado este paciente entretanto: vuelva a mirarlo y luego guarde',
  'the account has been changed by somebody else meanwhile: log in again':
    'otra persona ha cambiado la cuenta entretanto: inicie sesión de nuevo',
  'no enabled engineer would be left: make another one first':
    'no quedaría ningún ingeniero activo: cree antes otro',
  'name must be small letters, digits, \'.\', \'-\' or \'_\', and not begin with a dot':
    'el nombre solo admite minúsculas, cifras, «.», «-» o «_», y no empieza por punto',
  'the old password is wrong': 'la contraseña anterior es incorrecta',
  'the new password is the old one': 'la contraseña nueva es la anterior',
  'choose a password of your own first': 'elija antes una contraseña propia',
  'the setup code is wrong; it is printed on the console and in the journal':
    'el código de puesta en marcha es incorrecto; está en la consola y en el diario',
  'this appliance is set up already; log in': 'este equipo ya está puesto en marcha; inicie sesión',
  'the session has ended: log in again': 'la sesión ha terminado: inicie sesión de nuevo',
  'too many people are logging in; try again in a few seconds':
    'hay demasiados inicios de sesión en espera; pruebe en unos segundos',
  'no screen shows this code; a code is valid for 10 minutes':
    'ninguna pantalla muestra este código; un código vale 10 minutos',
  '20 screens are paired already: remove one first':
    'ya hay 20 pantallas emparejadas: quite antes una',
  'there is no such display': 'no existe esa pantalla',
  // Storage.
  'the store is busy: try again': 'el almacén está ocupado: pruebe de nuevo',
  'too many requests at once; try again in a few seconds':
    'se pide demasiado a la vez; pruebe en unos segundos',
  'too much data is being sent; try again in a few seconds':
    'se está enviando demasiado; pruebe en unos segundos',
  'no folder for backups is configured: set backup_folder in [storage]':
    'no hay carpeta de copias configurada: indique backup_folder en [storage]',
  'a backup is being made already': 'ya se está haciendo una copia',
  'a backup is being made, and nothing is removed meanwhile: try again when it is done':
    'se está haciendo una copia y entretanto no se borra nada: pruebe cuando termine',
  'internal error; the journal has the details': 'error interno; el diario del equipo dice más',
  // Update.
  'the machine is being restarted': 'el equipo se está reiniciando',
  'the machine is being asked to restart already': 'ya se ha pedido el reinicio del equipo',
  'a system update is being installed: wait until it is done':
    'se está instalando una actualización: espere a que termine',
  'a bundle is being installed: wait until it is done':
    'se está instalando un archivo: espere a que termine',
  'another bundle is being installed: wait until it is done':
    'se está instalando otro archivo: espere a que termine',
  'another file is being uploaded: wait until it has arrived':
    'se está enviando otro archivo: espere a que llegue',
  'the session of a patient is open: close it first, then restart':
    'hay una sesión de un paciente abierta: ciérrela y reinicie después',
  'the disk is busy: try again': 'el disco está ocupado: pruebe de nuevo',
  'there are too many bundles: remove one first': 'hay demasiados archivos: quite antes uno',
  'there is no such bundle': 'no existe ese archivo de actualización',
  'there is no installer (RAUC) on this machine': 'no hay instalador (RAUC) en esta máquina',
  'the installer cannot be reached': 'el instalador no responde',
  'the installer does not say why': 'el instalador no dice por qué',
  'the installer\'s answer cannot be read: is it RAUC 1.8?':
    'no se entiende la respuesta del instalador: ¿es RAUC 1.8?',
  'the connection to the installer broke: look at its log, then try again':
    'se cortó la conexión con el instalador: mire su diario y pruebe de nuevo',
  'the installer ended before it was done: look at its log, then try again':
    'el instalador acabó antes de tiempo: mire su diario y pruebe de nuevo',
  'the machine has not been rolled back': 'el equipo no ha vuelto a otro sistema',
  'the bundle became shorter while it was read; send it again':
    'el archivo se acortó mientras se leía; envíelo de nuevo',
  'a bundle\'s name must end with .raucb':
    'el nombre de un archivo de actualización acaba en .raucb',
  'checking the signature': 'comprobando la firma',
  // Why a scan failed.
  'out of memory: make a shorter sweep, or close other programs':
    'falta memoria: barra un trayecto más corto o cierre lo que esté en marcha',
  'the sensor\'s stream ended': 'se cortó la señal del sensor',
  'put a backup of the scan\'s files in their place, or take a new reference':
    'ponga una copia de los archivos del escaneo en su lugar o escanee una referencia nueva',
  cancelled: 'descartado',
  // Details of the log.
  'site and note': 'localización y nota', site: 'localización', note: 'nota',
  'wrong code': 'código incorrecto', 'its files are there again': 'sus archivos han vuelto',
  'of a scan that had not ended': 'de un escaneo que no había terminado',
  'of a scan that was removed': 'de un escaneo que se borró',
  'of a scan that failed': 'de un escaneo que falló',
  'of a scan that was discarded': 'de un escaneo que se descartó',
  'no scan of this number is known: is it of another database?':
    'no se conoce ningún escaneo con este número: ¿es de otra base de datos?',
  'it is complete, but its scan was never recorded as finished':
    'está completa, pero su escaneo nunca se anotó como terminado',
  'name a folder on another disk, such as one that is mounted at /var/lib/plumb-backup':
    'indique una carpeta de otro disco, como uno montado en /var/lib/plumb-backup',
  'a scan is running or being computed: wait for its result':
    'hay un escaneo en curso o calculándose: espere su resultado',
};

export const kFaultPatterns = [
  ['^there is a patient with the code (\\S+) already: choose another code \\(capital and small '
    + 'letters count as the same\\)$',
  'ya hay un paciente con el código $1: elija otro (mayúsculas y minúsculas cuentan igual)'],
  ['^too many wrong passwords; wait (\\d+) seconds$',
    'demasiadas contraseñas incorrectas; espere $1 segundos'],
  ['^too many wrong setup codes; wait (\\d+) seconds$',
    'demasiados códigos de instalación incorrectos; espere $1 segundos'],
  ['^the scan of this reference is not as it was stored: (.+); put a backup of its files in their '
    + 'place, or scan again$',
  'el escaneo de esta referencia no está como se guardó: $1; ponga una copia de sus archivos en '
    + 'su lugar o escanee de nuevo'],
  // Storage.
  ['^the disk is full: (\\d+) MB are free, a scan may need (\\d+); remove scans that are no '
    + 'longer needed$',
  'el disco está lleno: quedan $1 MB y un escaneo puede necesitar $2; borre escaneos que no hagan '
    + 'falta'],
  ['^The approved references of some patients \\((\\d+)\\) cannot be used, because their files are '
    + 'missing or changed: put the files back from a backup, or scan and approve new '
    + 'references\\.?$',
  'No se pueden usar las referencias aprobadas de algunos pacientes ($1), porque sus archivos '
    + 'faltan o han cambiado: recupérelos de una copia de seguridad, o escanee y apruebe '
    + 'referencias nuevas.'],
  ['^Files of some stored scans \\((\\d+)\\) are missing or changed: put them back from a backup, '
    + 'or remove these scans\\. The log names them\\.?$',
  'Faltan o han cambiado archivos de algunos escaneos guardados ($1): recupérelos de una copia de '
    + 'seguridad o borre esos escaneos. El registro los nombra.'],
  ['^Some scan folders \\((\\d+)\\) have no entry in the database and were moved to the '
    + 'set-aside folder\\. Restore a more recent backup, or move them to another disk\\.?$',
  'Algunas carpetas de escaneos ($1) no constan en la base de datos y se movieron a la carpeta '
    + '«set-aside». Restaure una copia de seguridad más reciente, o muévalas a otro disco.'],
  ['^No backup is set up: if this disk fails, all scans are lost\\. Mount another disk for '
    + 'backups, and name it as backup_folder in \\[storage\\]\\.?$',
  'No hay copias de seguridad configuradas: si falla este disco, se pierden todos los escaneos. '
    + 'Monte otro disco para las copias e indíquelo como backup_folder en [storage].'],
  ['^from (.+), with the files that were stored$', 'desde $1, con los archivos que se guardaron'],
  ['^the folder of the scans (.+) is not the one that was opened: if its disk is not mounted any '
    + 'more, mount it again; if this is the right one, start plumbd again$',
  'la carpeta de los escaneos $1 no es la que se abrió: si su disco ya no está montado, vuelva a '
    + 'montarlo; si es la correcta, arranque plumbd de nuevo'],
  ['^no backup is made at (.+): this folder of plumbd is visible to its service only and is '
    + 'deleted with it; (.+)$',
  'no se hace ninguna copia en $1: solo el servicio de plumbd ve esta carpeta, que se borra con '
    + 'él; $2'],
  ['^no backup is made at (.+): this folder lies in memory and is empty after a restart of the '
    + 'machine; (.+)$',
  'no se hace ninguna copia en $1: esta carpeta está en la memoria y queda vacía al reiniciar el '
    + 'equipo; $2'],
  ['^the disk is too full: (\\d+) MB are free$', 'el disco está demasiado lleno: quedan $1 MB'],
  ['^cannot write to (.+): (.+); check the disk and make it writable$',
    'no se puede escribir en $1: $2; revise el disco y permita escribir en él'],
  ['^nothing can be backed up in safe mode: (.+)$',
    'en modo seguro no se puede hacer ninguna copia: $1'],
  ['^the configuration cannot be used: (.+)\\. Correct the file, then restart: '
    + 'systemctl restart plumbd$',
  'no se puede usar la configuración: $1. Corrija el archivo y reinicie: systemctl restart plumbd'],
  ['^the database (.+) is damaged \\((.+)\\): put a backup in its place, or move it and the folder '
    + 'scans away to start over$',
  'la base de datos $1 está dañada ($2): ponga una copia en su lugar, o retire esa base y la '
    + 'carpeta scans para empezar de nuevo'],
  ['^The audit log has been changed or shortened from outside: entry (\\d+) is not as it was '
    + 'written\\. Compare it with a backup$',
  'El registro de auditoría se ha cambiado o acortado desde fuera: la entrada $1 no está como se '
    + 'escribió. Compárelo con una copia'],
  ['^The audit log cannot be checked: (.+)$', 'No se puede comprobar el registro de auditoría: $1'],
  ['^The last backup lies on the disk of the scans itself and is lost with it: mount the disk for '
    + 'backups at (.+)$',
  'La última copia está en el mismo disco que los escaneos y se pierde con él: monte el disco de '
    + 'copias en $1'],
  ['^what is stored cannot be read: (.+)$', 'no se puede leer lo guardado: $1'],
  ['^(.+) cannot be read: (.+); it was changed from outside, or its disk failed\\. Put a backup of '
    + 'the database in its place, or save it again$',
  'no es posible leer $1: $2; se cambió desde fuera o falló el disco. Ponga una copia de la base '
    + 'de datos en su lugar o guárdelo de nuevo'],
  ['^nobody can log in: (.+)$', 'nadie puede identificarse: $1'],
  ['^no scan can begin: (.+)$', 'no puede empezar ningún escaneo: $1'],
  ['^(\\d+) of (\\d+) stored scans cannot be seen \\(of scan (\\S+), (.+)\\): is the disk mounted '
    + 'at (.+)\\? Nothing was changed\\. .+$',
  'no se ven $1 de los $2 escaneos guardados (del escaneo $3, $4): ¿está montado el disco en $5? '
    + 'No se ha cambiado nada. Monte el disco o ponga una copia en su lugar y reinicie plumbd; si '
    + 'los archivos se han perdido para siempre, confírmelo con lost_scans = $1 en '
    + 'plumb-recovery.toml (guía de campo)'],
  ['^(\\d+) of (\\d+) stored scans were confirmed as lost$',
    'se confirmó la pérdida de $1 de los $2 escaneos guardados'],
  // Sensor and scan.
  ['^the scan could not begin: (.+)$', 'el escaneo no pudo empezar: $1'],
  ['^the scan failed: (.+)$', 'el escaneo falló: $1'],
  ['^the scan does not fit its reference: (.+)$', 'el escaneo no encaja con su referencia: $1'],
  ['^the patient\'s reference cannot be (?:read|used): (.+); (put a backup .+)$',
    'la referencia del paciente no se puede usar: $1; $2'],
  ['^its files cannot be used now: (.+)$', 'sus archivos no se pueden usar ahora: $1'],
  ['^sensor (\\S+) delivered no pair of images for (\\d+) ms \\(.+\\); unplug it and plug it in '
    + 'again$',
  'el sensor $1 no ha dado ningún par de imágenes en $2 ms; desconéctelo y vuelva a conectarlo'],
  ['^the driver of sensor (\\S+) reports an error; unplug it and plug it in again$',
    'el controlador del sensor $1 comunica un error; desconéctelo y vuelva a conectarlo'],
  ['^the sensor (\\S+) is not attached, but (\\S+) is: attach the configured one or change '
    + 'appliance.sensor_serial$',
  'el sensor $1 no está conectado, pero sí $2: conecte el configurado o cambie '
    + 'appliance.sensor_serial'],
  ['^the recording has (\\d+) usable frame\\(s\\), a scene needs at least 2: record a sweep$',
    'el barrido tiene $1 imágenes útiles y una escena necesita al menos 2: barra de nuevo'],
  ['^none of (\\d+) frames shows a marker or a surface: check that the sensor looks at the scene '
    + 'from 0.5 to 1.5 m$',
  'ninguna de las $1 imágenes muestra un marcador o una superficie: compruebe que el sensor mira '
    + 'desde 0,5 a 1,5 m'],
  ['^no surface was seen alike by two of (\\d+) keyframes \\(depth ([\\d.]+) m in the median\\): '
    + 'sweep slowly over a scene that stands still$',
  'dos de las $1 imágenes clave no vieron igual ninguna superficie (profundidad mediana $2 m): '
    + 'barra despacio una escena quieta'],
  // The page's certificate, and how browsers are known again.
  ['^the page\'s certificate (.+) is valid only from (.+): browsers refuse it; check the clock$',
    'el certificado de la página, $1, no vale hasta el $2: los navegadores lo rechazan; compruebe '
    + 'el reloj'],
  ['^the page\'s certificate (.+) ended on (.+): browsers refuse it; put a new one in its place$',
    'el certificado de la página, $1, caducó el $2: los navegadores lo rechazan; ponga uno nuevo '
    + 'en su lugar'],
  ['^the page\'s certificate (.+) ends on (.+): browsers refuse it from then on; put a new one in '
    + 'its place before$',
  'el certificado de la página, $1, caduca el $2: desde entonces los navegadores lo rechazan; '
    + 'ponga antes uno nuevo en su lugar'],
  ['^the key of the page\'s certificate (.+) is too weak \\((\\d+) bits\\): browsers refuse it; '
    + 'make one of 256 bits on an elliptic curve, or of 2048 with RSA$',
  'la clave del certificado de la página, $1, es demasiado débil ($2 bits): los navegadores la '
    + 'rechazan; haga una de 256 bits en una curva elíptica, o de 2048 con RSA'],
  ['^the page\'s certificate cannot be read: (.+); expected PEM$',
    'no se puede leer el certificado de la página: $1; se esperaba PEM'],
  ['^the certificate (.+) has a key of only (\\d+) bits: make one of 256 on an elliptic curve, or '
    + 'of 2048 with RSA$',
  'el certificado $1 tiene una clave de solo $2 bits: haga una de 256 en una curva elíptica, o de '
    + '2048 con RSA'],
  ['^the certificate (.+) ended on (.+): upload a newer one$',
    'el certificado $1 caducó el $2: entregue uno más nuevo'],
  ['^the certificate (.+) is valid only from (.+): check the clock$',
    'el certificado $1 no vale hasta el $2: compruebe el reloj'],
  ['^the certificate (\\S+) cannot be served \\((.+)\\); expected PEM: the certificate of this '
    + 'machine, then each that leads from it to an authority$',
  'no se puede servir el certificado $1 ($2); se esperaba PEM: el certificado de este equipo y '
    + 'después cada uno que lleva de él a una autoridad'],
  ['^the certificate was not replaced: (.+)$', 'el certificado no se cambió: $1'],
  ['^(.+): the key is not that of the certificate; give the two that were made together$',
    '$1: la clave no es la del certificado; dé los dos que se hicieron juntos'],
  ['^(.+): (holds .+) \\((.+)\\); expected PEM files as `openssl req` writes them$',
    '$1: $2 ($3); se esperaban archivos PEM como los escribe `openssl req`'],
  ['^the certificate of the page is for this run only: (.+); remove or correct the file$',
    'el certificado de la página vale solo hasta reiniciar: $1; borre o corrija el archivo'],
  ['^(\\S+) has (\\d+) bytes, expected (\\d+): browsers are not known again after a restart; '
    + 'remove the file$',
  '$1 tiene $2 bytes y se esperaban $3: tras reiniciar no se reconoce ningún navegador; borre el '
    + 'archivo'],
  ['^browsers are not known again after a restart: (.+)$',
    'tras reiniciar no se reconoce ningún navegador: $1'],
  ['^(\\S+) is not a regular file: (.+)$', '$1 no es un archivo normal: $2'],
  ['^web\\.listen: (.+); the page is served at (\\S+) instead$',
    'web.listen: $1; la página se sirve en $2'],
  ['^(\\S+) is no address of this machine now: the page cannot be reached before it is '
    + '\\(web\\.listen\\)$',
  '$1 no es ahora una dirección de este equipo: hasta que lo sea no se llega a la página '
    + '(web.listen)'],
  // Update.
  ['^(.+) is installed: restart the appliance to use it$',
    '$1 está instalado: reinicie el equipo para usarlo'],
  ['^(.+) was not installed: (.+)$', '$1 no se instaló: $2'],
  ['^version (\\S+) was installed, but the machine has gone back to the previous system, (\\S+): '
    + 'the new one did not start or was not fit for work$',
  'se instaló la versión $1, pero el equipo ha vuelto al sistema anterior, $2: el nuevo no arrancó '
    + 'o no servía para trabajar'],
  ['^(.+) is too short for a bundle: (\\d+) bytes; copy it again$',
    '$1 es demasiado corto para ser una actualización: $2 bytes; cópielo de nuevo'],
  ['^(.+) is too large: (\\d+) MB, at most (\\d+) MB$',
    '$1 es demasiado grande: $2 MB; como máximo $3 MB'],
  ['^(.+) is not a bundle: expected a squashfs image$',
    '$1 no es una actualización: se esperaba una imagen squashfs'],
  ['^(.+) is not a complete bundle: no signature at its end; copy it again$',
    '$1 no está entero: le falta la firma del final; cópielo de nuevo'],
  ['^the disk is too full for a bundle of (\\d+) MB: (\\d+) MB are free$',
    'el disco está demasiado lleno para un archivo de $1 MB: quedan $2 MB'],
  ['^the bundle was damaged on its way: its contents are not what was signed; copy it again \\(the '
    + 'installer: (.*)\\)$',
  'el archivo se dañó por el camino: su contenido no es el que se firmó; cópielo de nuevo '
    + '(instalador: $1)'],
  ['^the bundle is not signed by a key that this machine trusts: it came as it was made, so ask '
    + 'who made it \\(the installer: (.*)\\)$',
  'el archivo no está firmado con una clave en la que este equipo confíe: llegó como se hizo; '
    + 'pregunte a quien lo hizo (instalador: $1)'],
  ['^the installer refuses this bundle: (.*)$', 'el instalador rechaza este archivo: $1'],
  ['^the installer did not begin: (.*)$', 'el instalador no empezó: $1'],
  ['^the installer has made no progress for (\\d+) minutes, at (\\d+) % of \'(.+)\': restart the '
    + 'appliance, then try again$',
  'el instalador no avanza desde hace $1 minutos, al $2 % de «$3»: reinicie el equipo y pruebe de '
    + 'nuevo'],
  ['^this bundle is for another machine: it is for \'(.*)\', this is \'(.*)\'$',
    'este archivo es para otra máquina: es para «$1» y esta es «$2»'],
  ['^this bundle holds version (\\S+), older than (\\S+) which runs$',
    'este archivo contiene la versión $1, anterior a la $2, que está en uso'],
  ['^this bundle holds version \'(.*)\': expected numbers separated by dots, such as 0.2.1; '
    + 'ask who made it$',
  'este archivo contiene la versión «$1»: se esperaban números separados por puntos, como 0.2.1; '
    + 'pregunte a quien lo hizo'],
  ['^the machine cannot be restarted from here: (.+); restart it at its console or its switch$',
    'el equipo no se puede reiniciar desde aquí: $1; reinícielo en su consola o en su interruptor'],
  // Details of the log.
  ['^scan (\\S+)$', 'escaneo $1'],
  ['^(\\d+) scans?$', '$1 escaneos'],
  ['^(\\d+) scans had not ended$', '$1 escaneos no habían terminado'],
  ['^(.+): (\\d+) scans, (\\d+) files, (\\d+) bytes, (\\d+) problems(, encrypted)?$',
    '$1: $2 escaneos, $3 archivos, $4 bytes, $5 problemas$6'],
  ['^, encrypted$', ', cifrada'],
  ['^(.+) to (.+): (\\d+) scans, (\\d+) references, (\\d+) problems(, encrypted)?$',
    '$1 a $2: $3 escaneos, $4 referencias, $5 problemas$6'],
  ['^(.+); before: (.+)$', '$1; antes: $2'],
  ['^(\\d+) markers$', '$1 marcadores'],
  ['^check (\\d+) with (\\d+) markers$', 'control $1 con $2 marcadores'],
  ['^version (\\d+), sha256 (\\w+)$', 'versión $1, sha256 $2'],
  ['^region ([\\d.]+) x ([\\d.]+) mm, tolerance ([\\d.]+) mm and ([\\d.]+) degrees$',
    'región $1 x $2 mm, tolerancia $3 mm y $4°'],
  ['^(.+): region ([\\d.]+) x ([\\d.]+) mm, tolerance ([\\d.]+) mm and ([\\d.]+) degrees$',
    '$1: región $2 x $3 mm, tolerancia $4 mm y $5°'],
  ['^scans differ by ([\\d.]+) mm and ([\\d.]+) deg, sha256 (\\w+)$',
    'los escaneos difieren en $1 mm y $2°, sha256 $3'],
  ['^to version (\\d+), which is version (\\d+) now$', 'a la versión $1, que ahora es la $2'],
  ['^version (\\d+)$', 'versión $1'],
  ['^(.+); nothing was deleted$', '$1; no se borró nada'],
];
